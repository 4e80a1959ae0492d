//! Multi-scale contrast enhancement that does not amplify noise and strong edges.

use crate::image::latitude::LatitudeReduction;
use crate::image::pyramid::{Plane, white_noise_of_bands};

/// Ratio of the local mean square of a band to that of its noise at which detail gets half its lift.
const NOISE_CORE: f32 = 4.0;

/// Selection and amount of the lift.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Lift {
    /// Latitude reduction of the image; small, faint, significant detail regains the contrast lost by it.
    pub reduction: LatitudeReduction,
    /// Share of the contrast before the reduction that is added to such detail.
    pub detail: f64,
    /// Size above which detail is lifted by less than half, in pixels.
    pub size_px: f64,
    /// Contrast before the reduction above which detail is lifted by less than half.
    pub edge: f64,
}

/// Lifts every band of the Laplacian pyramid of an image of reduced latitude.
///
/// A detail d in a band of size b becomes d (1 + (D (1 + L) − 1) n e b′) with L the share `detail` and D the divisor of the latitude
/// reduction at the local mean, so that it ends with 1 + L times the contrast before the reduction. The local strength of detail,
/// A² = ⟨d²⟩ over a few samples of the band, determines the factors: with the noise s² of the band, n = A⁴ / (A⁴ + (2 s)⁴) keeps noise
/// unchanged, e = 1 / (1 + (D A / edge)⁴) keeps strong edges and their surroundings without halo, and b′ = 1 / (1 + (b / size)²) leaves
/// large areas to the window. `sigma` is the standard error of every pixel of the reduced image; noise is assumed to be white.
pub(crate) fn lifted(image: &Plane, sigma: &[f32], lift: &Lift) -> Vec<f32> {
    let shorter = image.columns.min(image.rows);
    // Bands larger than the image, or so coarse that they hardly get a lift, are unchanged.
    let coarsest = lift.size_px.max(1.0).log2().ceil() as u32 + 3;
    let bands = shorter.max(1).ilog2().min(coarsest) as usize;
    let noise = white_noise_of_bands(bands);
    let mut finer = image.clone();
    let mut variance = Plane {
        values: sigma.iter().map(|s| s * s).collect(),
        ..image.clone()
    };
    let full = (1.0 + lift.detail) as f32;
    let mut details = Vec::with_capacity(bands);
    for (band, noise) in noise.iter().enumerate() {
        let half = finer.halved();
        let size_px = f64::from(1_u32 << band);
        let fineness = (1.0 / (1.0 + (size_px / lift.size_px).powi(2))) as f32;
        let core = NOISE_CORE * (noise * noise) as f32;
        let per_edge = (1.0 / (lift.edge * lift.edge)) as f32;
        let mut detail = finer;
        let smooth = half.doubled(detail.columns, detail.rows);
        for (value, smooth) in detail.values.iter_mut().zip(&smooth.values) {
            *value -= smooth;
        }
        let strength = local_strength(&detail);
        for (((value, &strength), &variance), &smooth) in detail
            .values
            .iter_mut()
            .zip(&strength.values)
            .zip(&variance.values)
            .zip(&smooth.values)
        {
            let divisor = lift.reduction.divisor(f64::from(smooth)) as f32;
            let most = fineness * (divisor * full - 1.0);
            let noise = core * variance;
            // The smallest number prevents 0 / 0 where there is neither detail nor noise.
            let significant =
                strength * strength / (strength * strength + noise * noise + f32::MIN_POSITIVE);
            *value *= 1.0
                + most * significant / (1.0 + (strength * divisor * divisor * per_edge).powi(2));
        }
        details.push(detail);
        variance = variance.halved();
        finer = half;
    }
    let mut result = finer;
    for detail in details.into_iter().rev() {
        result = result.doubled(detail.columns, detail.rows);
        for (value, detail) in result.values.iter_mut().zip(&detail.values) {
            *value += detail;
        }
    }
    result.values
}

/// Mean square of a band around every sample.
fn local_strength(detail: &Plane) -> Plane {
    let square = Plane {
        values: detail.values.iter().map(|d| d * d).collect(),
        columns: detail.columns,
        rows: detail.rows,
    };
    square
        .halved()
        .halved()
        .doubled(detail.columns.div_ceil(2), detail.rows.div_ceil(2))
        .doubled(detail.columns, detail.rows)
}

#[cfg(test)]
mod tests {
    use ppa_core::random::Philox;

    use super::*;

    /// The lift of the default presentation on pixels of 0.5 mm.
    const LIFT: Lift = Lift {
        reduction: LatitudeReduction(0.5),
        detail: 1.5,
        size_px: 16.0,
        edge: 0.12,
    };

    fn reduced(log_exposure: f32) -> f32 {
        LIFT.reduction.reduced(f64::from(log_exposure)) as f32
    }

    fn image(columns: usize, rows: usize, value: impl Fn(f32, f32) -> f32) -> Plane {
        let at = |i: usize| value((i % columns) as f32 + 0.5, (i / columns) as f32 + 0.5);
        Plane {
            columns,
            rows,
            values: (0..columns * rows).map(at).collect(),
        }
    }

    /// Applies the presentation to a log exposure with a standard error.
    fn enhance(image: &Plane, sigma: f32) -> Vec<f32> {
        let values: Vec<f32> = image.values.iter().map(|&a| reduced(a)).collect();
        let divisor = |&t: &f32| LIFT.reduction.divisor(f64::from(t)) as f32;
        let sigma: Vec<f32> = values.iter().map(|t| sigma / divisor(t)).collect();
        lifted(
            &Plane {
                values,
                ..image.clone()
            },
            &sigma,
            &LIFT,
        )
    }

    fn width(values: &[f32]) -> f64 {
        let n = values.len() as f64;
        let mean = values.iter().map(|&v| f64::from(v)).sum::<f64>() / n;
        let squares = values.iter().map(|&v| (f64::from(v) - mean).powi(2));
        (squares.sum::<f64>() / n).sqrt()
    }

    /// Noise of an even region grows by less than half of what the reduction leaves, and stays below 1.2 times its original value. Detail
    /// of the same width gets at least 1.8 times its contrast. 65 000 pixels: standard error below 1 %.
    #[test]
    fn noise_of_even_regions_stays() {
        for (level, sigma) in [(0.0, 0.005_f32), (2.0, 0.005), (2.0, 0.05), (4.5, 0.05)] {
            let mut rng = Philox::new(11, 0, 1);
            let mut noisy = image(256, 256, |_, _| level);
            for value in &mut noisy.values {
                *value += sigma * rng.normals()[0] as f32;
            }
            let shown = width(&enhance(&noisy, sigma));
            let left: Vec<f32> = noisy.values.iter().map(|&a| reduced(a)).collect();
            let growth = shown / width(&left);
            assert!((1.0..1.5).contains(&growth), "{level}: {growth}");
            assert!(shown < 1.2 * width(&noisy.values), "{level}");
            // The same detail is lifted if it is not noise.
            assert!(width(&enhance(&noisy, 0.0)) > 1.8 * width(&noisy.values));
        }
    }

    /// A joint space: a gap 3 mm wide with 0.15 less log exposure gets twice its original contrast, in front of thin and thick parts.
    #[test]
    fn a_joint_space_is_lifted() {
        for level in [2.0, 4.0] {
            let gap = image(200, 200, |x, _| {
                if (x - 100.0).abs() < 3.0 {
                    level - 0.15
                } else {
                    level
                }
            });
            let shown = enhance(&gap, 0.01);
            let depth = shown[100 * 200 + 60] - shown[100 * 200 + 100];
            assert!(depth > 2.0 * 0.15, "{level}: {depth}");
        }
    }

    /// Overshoot next to an edge as a share of the reduced step: of a metal plate in air and on bone, of skin, and of bone in soft
    /// tissue, whose overshoot is still less than half of the step before the reduction.
    #[test]
    fn strong_edges_get_no_halo() {
        for (level, step, blur_px, most) in [
            (0.0, 5.0, 0.1, 0.015),
            (2.0, 5.0, 0.1, 0.015),
            (0.0, 1.0, 4.0, 0.4),
            (2.0, 1.0, 2.0, 1.15),
        ] {
            let edge = image(300, 60, |x, _| {
                level + step / (1.0 + (-(x - 150.0) / blur_px).exp())
            });
            let shown = enhance(&edge, 0.005);
            let row = &shown[30 * 300..31 * 300];
            let [low, high] = [level, level + step].map(reduced);
            let over = row.iter().fold(0.0, |most: f32, v| most.max(v - high));
            let under = row.iter().fold(0.0, |most: f32, v| most.max(low - v));
            let overshoot = over.max(under) / (high - low);
            assert!(overshoot < most, "{level} {step}: {overshoot}");
        }
    }

    /// Large areas stay as reduced, so that more exposure is always darker there.
    #[test]
    fn large_areas_keep_their_value_and_order() {
        let stairs = image(800, 120, |x, _| 0.8 * (x / 160.0).floor());
        let shown = enhance(&stairs, 0.0);
        for step in 0..5 {
            let value = shown[60 * 800 + 80 + 160 * step];
            let expected = reduced(0.8 * step as f32);
            assert!(
                (value - expected).abs() < 0.02,
                "{step}: {value} {expected}"
            );
        }
    }

    #[test]
    fn small_images_and_no_lift_are_fine() {
        for (columns, rows) in [(1, 1), (3, 1), (5, 9)] {
            let small = image(columns, rows, |x, y| 0.3 * x - 0.1 * y);
            assert_eq!(enhance(&small, 0.1).len(), columns * rows);
            let none = Lift {
                reduction: LatitudeReduction(0.0),
                detail: 0.0,
                ..LIFT
            };
            let same = lifted(&small, &vec![0.1; columns * rows], &none);
            for (a, b) in same.iter().zip(&small.values) {
                assert!((a - b).abs() < 1e-5);
            }
        }
    }
}
