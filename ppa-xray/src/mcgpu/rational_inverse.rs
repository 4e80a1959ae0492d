//! Densities from a rational inverse cumulative distribution ("RITA", PENELOPE-2006 manual, NEA 6222, section 1.2.4).

/// Points per interval.
const POINTS: usize = 4;

/// Abscissae and densities in the interval from x₀, where the cumulative probability is P₀, to x₁; a and b are its
/// parameters. The point at x₁ belongs to the next interval.
///
/// In an interval of width Δx and probability ΔP, x = x₀ + (1 + a + b) η / (1 + aη + bη²) Δx for uniform η, so that
/// dP/dx = ΔP/Δx (1 + aη + bη²)² / ((1 + a + b)(1 − bη²)).
pub(super) fn density_in_interval(
    [x0, p0, a, b]: [f64; 4],
    [x1, p1]: [f64; 2],
) -> [[f64; 2]; POINTS] {
    let (width, probability) = (x1 - x0, p1 - p0);
    let scale = 1.0 + a + b;
    std::array::from_fn(|point| {
        let eta = point as f64 / POINTS as f64;
        let denominator = 1.0 + (a + b * eta) * eta;
        let x = x0 + scale * eta / denominator * width;
        let density =
            probability / width * denominator * denominator / (scale * (1.0 - b * eta * eta));
        [x, density]
    })
}
