//! Smooth combinations of signed distances: the quadratic polynomial blend, which never raises the slope above that of its parts.

/// Smooth minimum of two distances; the blend is `k` mm wide and at most `k / 4` deep.
pub(super) fn smooth_min(a: f64, b: f64, k: f64) -> f64 {
    let h = (k - (a - b).abs()).max(0.0);
    a.min(b) - h * h / (4.0 * k.max(1e-9))
}

/// Smooth maximum, the mirror image of [`smooth_min`].
pub(super) fn smooth_max(a: f64, b: f64, k: f64) -> f64 {
    -smooth_min(-a, -b, k)
}

/// Smooth step from 0 at `low` to 1 at `high`.
pub(super) fn smooth_step(low: f64, high: f64, x: f64) -> f64 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}
