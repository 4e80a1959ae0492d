//! Selection of vector instructions, and vectorised elementary functions.

use pulp::{Arch, Scalar, Simd, WithSimd};

/// Runs a kernel with the widest vectors that this machine supports and that divide the number of channels.
pub fn dispatch<K: WithSimd>(channels: usize, kernel: K) -> K::Output {
    match Arch::new() {
        #[cfg(target_arch = "x86_64")]
        Arch::V4(simd) if channels.is_multiple_of(16) => Simd::vectorize(simd, kernel),
        #[cfg(target_arch = "x86_64")]
        Arch::V4(_) | Arch::V3(_) if channels.is_multiple_of(8) => match pulp::x86::V3::try_new() {
            Some(simd) => Simd::vectorize(simd, kernel),
            None => Simd::vectorize(Scalar, kernel),
        },
        #[cfg(target_arch = "aarch64")]
        Arch::Neon(simd) if channels.is_multiple_of(4) => Simd::vectorize(simd, kernel),
        _ => Simd::vectorize(Scalar, kernel),
    }
}

/// Returns a slice as vectors; its length must be a multiple of theirs.
#[inline(always)]
pub fn lanes<S: Simd>(values: &[f32]) -> &[S::f32s] {
    let (vectors, rest) = S::as_simd_f32s(values);
    debug_assert!(rest.is_empty(), "a slice of {} values", values.len());
    vectors
}

/// The mutable version of [`lanes`].
#[inline(always)]
pub fn lanes_mut<S: Simd>(values: &mut [f32]) -> &mut [S::f32s] {
    let (vectors, rest) = S::as_mut_simd_f32s(values);
    debug_assert!(rest.is_empty());
    vectors
}

/// Writes a vector, or as many of its first values as fit into `to`.
#[inline(always)]
pub fn store<S: Simd>(simd: S, vector: S::f32s, to: &mut [f32]) {
    if to.len() == S::F32_LANES {
        lanes_mut::<S>(to)[0] = vector;
    } else {
        simd.partial_store_f32s(to, vector);
    }
}

/// a b + c, rounded once if the machine supports it. (The scalar version would need a function call.)
#[inline(always)]
pub fn fma<S: Simd>(simd: S, a: S::f32s, b: S::f32s, c: S::f32s) -> S::f32s {
    if S::IS_SCALAR {
        simd.add_f32s(simd.mul_f32s(a, b), c)
    } else {
        simd.mul_add_e_f32s(a, b, c)
    }
}

/// 1 / (1 + exp(-y)) to 3e-7.
///
/// exp(-y) = 2^n exp(-r) with |r| <= ln(2)/2, and exp(-r) by the polynomial of degree 5 with the least relative error, 7.5e-8.
/// y is clamped to ±87, where exp is a normal number: beyond that, the sigmoid is 0 or 1 to 2e-38.
#[inline(always)]
pub fn sigmoid<S: Simd>(simd: S, y: S::f32s) -> S::f32s {
    const LN2_HIGH: f32 = 0.693_359_4;
    const LN2_LOW: f32 = -2.121_944_4e-4;
    // Adding 1.5 * 2^23 leaves the nearest integer in the low bits of the mantissa, here plus the bias of an exponent.
    const ROUND: f32 = 12_582_912.0 + 127.0;
    let splat = |value| simd.splat_f32s(value);
    let y = simd.min_f32s(simd.max_f32s(y, splat(-87.0)), splat(87.0));
    let shifted = fma(simd, y, splat(-std::f32::consts::LOG2_E), splat(ROUND));
    let n = simd.sub_f32s(shifted, splat(ROUND));
    let r = fma(simd, n, splat(LN2_HIGH), y);
    let r = fma(simd, n, splat(LN2_LOW), r);
    let mut minus_exp = splat(8.297_655e-3);
    for coefficient in [
        -4.191_538e-2,
        1.666_757_5e-1,
        -4.999_889_5e-1,
        9.999_997e-1,
        -1.0,
    ] {
        minus_exp = fma(simd, minus_exp, r, splat(coefficient));
    }
    let power = simd.wrapping_dyn_shl_u32s(simd.transmute_u32s_f32s(shifted), simd.splat_u32s(23));
    let power = simd.transmute_f32s_u32s(power);
    minus_reciprocal(simd, fma(simd, minus_exp, power, splat(-1.0)))
}

/// Computes -1 / x of normal negative numbers to 1.2e-7, without a division.
///
/// The difference of bit patterns is a first approximation, as in the fast inverse square root; a step of Newton's method whose constant
/// is shifted with it leaves an error of 1.3e-3, and a step of third order 2e-9 before rounding.
#[inline(always)]
fn minus_reciprocal<S: Simd>(simd: S, x: S::f32s) -> S::f32s {
    const BITS: u32 = 0x7ef3_2880;
    const NEWTON: f32 = 2.001_3;
    let one = simd.splat_f32s(1.0);
    // BITS - the bits of -x
    let bits = simd.not_u32s(simd.transmute_u32s_f32s(x));
    let bits = simd.add_u32s(bits, simd.splat_u32s(BITS.wrapping_sub(0x7fff_ffff)));
    let first = simd.transmute_f32s_u32s(bits);
    let second = simd.mul_f32s(first, fma(simd, x, first, simd.splat_f32s(NEWTON)));
    let error = fma(simd, x, second, one);
    fma(simd, second, fma(simd, error, error, error), second)
}

/// SiLU y s(y).
#[inline(always)]
pub fn silu<S: Simd>(simd: S, y: S::f32s) -> S::f32s {
    simd.mul_f32s(y, sigmoid(simd, y))
}

/// SiLU y s(y) and its derivative s (1 + y (1 - s)).
#[inline(always)]
pub fn silu_and_derivative<S: Simd>(simd: S, y: S::f32s) -> (S::f32s, S::f32s) {
    let s = sigmoid(simd, y);
    let value = simd.mul_f32s(y, s);
    let rest = simd.sub_f32s(simd.splat_f32s(1.0), s);
    (value, fma(simd, value, rest, s))
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Both<'a>(&'a mut [f32]);

    impl WithSimd for Both<'_> {
        type Output = ();

        #[inline(always)]
        fn with_simd<S: Simd>(self, simd: S) {
            let (value, derivative) = self.0.split_at_mut(self.0.len() / 2);
            for (x, d) in lanes_mut::<S>(value)
                .iter_mut()
                .zip(lanes_mut::<S>(derivative))
            {
                (*x, *d) = silu_and_derivative(simd, *x);
            }
        }
    }

    #[test]
    fn silu_and_its_derivative_are_those_of_f64_with_all_widths() {
        let values: Vec<f32> = (0..4096).map(|i| (i as f32 - 2048.0) / 16.0).collect();
        for channels in [1, 8, 16] {
            let mut both = values.repeat(2);
            dispatch(channels, Both(&mut both));
            for (i, x) in values.iter().map(|&x| f64::from(x)).enumerate() {
                let s = 1.0 / (1.0 + (-x).exp());
                let (value, derivative) = (f64::from(both[i]), f64::from(both[4096 + i]));
                assert!(
                    (value - x * s).abs() <= 4e-7 * (x * s).abs() + 1e-30,
                    "{x}: {value}"
                );
                let expected = s * (1.0 + x * (1.0 - s));
                assert!(
                    (derivative - expected).abs() < 6e-7 * (1.0 + x.abs() * s),
                    "{x}: {derivative} {expected}"
                );
            }
        }
    }
}
