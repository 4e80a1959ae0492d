//! Arithmetic in `f32` that compilers vectorise and that gives the same bits on every machine.
//!
//! The polynomials are our own (minimax, by iteratively reweighted least squares; for the exponential that of (eʳ − 1 − r)/r²). There is no
//! library whose last digit depends on the platform, no fused multiply-add and no branch.

/// Number of values processed together.
pub(crate) const WIDTH: usize = 8;

/// Appends zeros up to a multiple of [`WIDTH`].
pub(crate) fn pad(values: &mut Vec<f32>) {
    values.resize(values.len().next_multiple_of(WIDTH), 0.0);
}

/// 1.5 · 2²³: adding it rounds to the nearest integer, which is then in the low bits.
const MAGIC: f32 = 12_582_912.0;

/// ln 2 in two parts; the first has few enough digits that its multiples are exact.
const LN2_HIGH: f32 = 0.693_359_4;
const LN2_LOW: f32 = -2.121_944_4e-4;

/// eˣ to a relative error of 2e-7 from −86 to 80; beyond, the value at the nearer limit.
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

/// Sine and cosine of `turn` full turns, `turn` in [0, 1); within 2e-7.
#[inline(always)]
pub(crate) fn sin_cos_turn(turn: f32) -> (f32, f32) {
    let quarters = turn * 4.0;
    let rounded = quarters + 8_388_608.0; // + 2²³: the whole number is in the low bits
    let nearest = rounded.to_bits();
    let r = quarters - (rounded - 8_388_608.0); // in [−½, ½] quarter turns
    let s = r * r;
    let sin = r
        * (std::f32::consts::FRAC_PI_2
            + s * (-0.645_963_46 + s * (7.968_003e-2 - s * 4.601_658e-3)));
    let cos = 0.999_999_97 + s * (-1.233_697 + s * (0.253_598_64 - s * 2.040_835_3e-2));
    let odd = nearest & 1 == 1;
    let (a, b) = (if odd { cos } else { sin }, if odd { sin } else { cos });
    let sign = |negative: bool| if negative { -1.0_f32 } else { 1.0 };
    (
        a * sign(nearest & 2 != 0),
        b * sign(nearest.wrapping_add(1) & 2 != 0),
    )
}

#[inline(always)]
pub(crate) fn least(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[inline(always)]
pub(crate) fn greatest(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// Largest integer not above `x`, for 0 ≤ x < 2²²; as a number and as an index.
///
/// Adding 2²³ rounds in the last place and leaves the integer in the low bits; casts and library calls would not vectorise.
#[inline(always)]
pub(crate) fn floor(x: f32) -> (f32, u32) {
    const MAGIC: f32 = 8_388_608.0;
    let rounded = (x + MAGIC) - MAGIC;
    let floor = rounded - if rounded > x { 1.0 } else { 0.0 };
    (floor, (floor + MAGIC).to_bits() & 0x007F_FFFF)
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

    #[test]
    fn sine_and_cosine_are_those_of_the_library_to_2e_7() {
        for step in 0..100_000 {
            let turn = step as f32 / 100_000.0;
            let (sin, cos) = sin_cos_turn(turn);
            let angle = std::f64::consts::TAU * f64::from(turn);
            let error = (f64::from(sin) - angle.sin()).hypot(f64::from(cos) - angle.cos());
            assert!(error < 2e-7, "{turn} turns: off by {error:e}");
        }
    }
}
