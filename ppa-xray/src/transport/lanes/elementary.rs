//! Sine, cosine and rounding in `f32` that compilers turn into vector code and that give the same bits on every machine.
//!
//! Polynomials of our own (minimax, by iteratively reweighted least squares): no library whose last digit depends on
//! the platform, and no fused multiply-add.

/// Sine and cosine of `turn` whole turns, `turn` in [0, 1); within 2e-7.
#[inline(always)]
pub(super) fn sin_cos_turn(turn: f32) -> (f32, f32) {
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
pub(super) fn least(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[inline(always)]
pub(super) fn greatest(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// Largest whole number not above `x`, for 0 ≤ x < 2²²; as a number and as an index.
///
/// Adding 2²³ rounds in the last place, and leaves the integer in the low bits: casts and libraries would not vectorise.
#[inline(always)]
pub(super) fn floor(x: f32) -> (f32, u32) {
    const MAGIC: f32 = 8_388_608.0;
    let rounded = (x + MAGIC) - MAGIC;
    let floor = rounded - if rounded > x { 1.0 } else { 0.0 };
    (floor, (floor + MAGIC).to_bits() & 0x007F_FFFF)
}

#[cfg(test)]
mod tests {
    use super::*;

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
