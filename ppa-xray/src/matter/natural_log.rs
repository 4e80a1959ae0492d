//! Bit-reproducible logarithm and exponential on every machine.

/// ln x of a positive, normal number, within 2e-7 of the value (of 0.05 where the value is smaller).
///
/// The system's mathematical library may differ in the last bit from machine to machine, which would change sampled
/// histories. Here x = 2ᵏ (1 + f) with f between √½ − 1 and √2 − 1, and ln(1 + f) = f + f² P(f) with P interpolated at the
/// Chebyshev points.
#[inline(always)]
pub(crate) fn ln(x: f32) -> f32 {
    const SQRT_HALF: u32 = 0x3f35_04f3;
    const P: [f32; 8] = [
        -0.499_999_94,
        0.333_336_6,
        -0.250_016_1,
        0.199_731_05,
        -0.165_750_47,
        0.148_064_6,
        -0.142_577_95,
        0.090_042_025,
    ];
    let above = x.to_bits().wrapping_sub(SQRT_HALF);
    let exponent = (above as i32 >> 23) as f32;
    let f = f32::from_bits((above & 0x007f_ffff) + SQRT_HALF) - 1.0;
    // Pairs first (Estrin): a shorter dependency chain than Horner's scheme.
    let square = f * f;
    let pair = |i: usize| P[i] + P[i + 1] * f;
    let p = (pair(0) + pair(2) * square) + (pair(4) + pair(6) * square) * (square * square);
    // ln 2 in two parts, the first exact in few bits, which keeps the product with k exact.
    exponent * 0.693_359_4 + (f + (square * p + exponent * -2.121_944_4e-4))
}

/// eˣ for x up to 88, within 6e-6 of the value; 0 below −87.
///
/// 2ᵏ times a polynomial in the fraction of x/ln 2, from −½ to ½.
pub(crate) fn exp(x: f32) -> f32 {
    // lnⁿ2/n!: the next term is at most 1.2e-7.
    const P: [f32; 7] = [
        1.0,
        std::f32::consts::LN_2,
        0.240_226_5,
        0.055_504_11,
        0.009_618_129,
        0.001_333_355_8,
        0.000_154_035_3,
    ];
    if x < -87.0 {
        return 0.0;
    }
    let octaves = x * std::f32::consts::LOG2_E;
    let whole = octaves.round();
    let fraction = octaves - whole;
    let mantissa = P.iter().rev().fold(0.0, |sum, &c| sum * fraction + c);
    mantissa * f32::from_bits(((whole as i32 + 127) as u32) << 23)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// From 2⁻⁷⁰ to 2⁷⁰, and densely around 1, where the result itself is small.
    #[test]
    fn follows_the_exact_logarithm() {
        let far = (0..200_000).map(|i| (f64::from(i) * 0.0007 - 70.0).exp2() as f32);
        let near = (0..200_000).map(|i| 0.9 + 1e-6 * i as f32);
        for x in far.chain(near) {
            let exact = f64::from(x).ln();
            let error = f64::from(ln(x)) - exact;
            assert!(
                error.abs() <= 2e-7 * exact.abs().max(0.05),
                "ln {x}: off by {error:e}"
            );
        }
        assert_eq!(ln(1.0), 0.0);
    }

    #[test]
    fn follows_the_exact_exponential() {
        for i in 0..170_000 {
            let x = (f64::from(i) * 0.001 - 86.0) as f32;
            let exact = f64::from(x).exp();
            let error = f64::from(exp(x)) / exact - 1.0;
            assert!(error.abs() < 6e-6, "exp {x}: {error}");
        }
        assert_eq!(exp(0.0), 1.0);
        assert_eq!(exp(-100.0), 0.0);
    }
}
