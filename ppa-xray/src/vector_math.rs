//! Arithmetic that compilers turn into vector code and that gives the same bits on every machine.
//!
//! The exponential is a polynomial of our own (minimax of (eʳ − 1 − r)/r², by iteratively reweighted least squares): no library whose last digit
//! depends on the platform, no fused multiply-add, no branch.

/// Numbers that are handled together.
pub(crate) const WIDTH: usize = 8;

/// Appends zeros up to a multiple of [`WIDTH`].
pub(crate) fn pad(values: &mut Vec<f32>) {
    values.resize(values.len().next_multiple_of(WIDTH), 0.0);
}

/// 1.5 · 2²³: adding it rounds to the nearest whole number, which is then in the low bits.
const MAGIC: f32 = 12_582_912.0;

/// ln 2 in two parts; the first has few enough digits that its multiples are exact.
const LN2_HIGH: f32 = 0.693_359_4;
const LN2_LOW: f32 = -2.121_944_4e-4;

/// eˣ within 2e-7, relative, from −86 to 80; beyond, the value at the nearer of the two.
#[inline(always)]
pub(crate) fn exp(x: f32) -> f32 {
    let x = if x > -86.0 { x } else { -86.0 };
    let x = if x < 80.0 { x } else { 80.0 };
    let shifted = x * std::f32::consts::LOG2_E + MAGIC;
    let twos = shifted - MAGIC;
    let r = (x - twos * LN2_HIGH) - twos * LN2_LOW;
    let tail = 0.499_999_93
        + r * (0.166_665_2 + r * (4.166_840_8e-2 + r * (8.368_922e-3 + r * 1.381_417_4e-3)));
    let power = 1.0 + (r + r * r * tail);
    f32::from_bits(power.to_bits().wrapping_add(shifted.to_bits() << 23))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exponentials_are_those_of_the_library_to_2e_7() {
        let largest = (0..=200_000)
            .map(|step| -86.0 + 166.0 * f64::from(step) / 200_000.0)
            .map(|x| {
                let x = x as f32;
                (f64::from(exp(x)) / f64::from(x).exp() - 1.0).abs()
            })
            .fold(0.0, f64::max);
        assert!(largest < 2e-7, "{largest:e}");
        assert_eq!(exp(0.0), 1.0);
        assert!(exp(f32::NEG_INFINITY) < 1e-37 && exp(-1e30) < 1e-37);
    }
}
