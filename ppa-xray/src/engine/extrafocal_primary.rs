//! Primary image of extrafocal photons: rays to pixels as wide as its blur, interpolated to the pixels of the detector by cubics.
//!
//! docs/physics.md, "Extrafocal radiation".

use crate::beam::detector::Detector;
use crate::beam::projection::Projection;
use crate::engine::adaptive_primary::primary_moments;
use crate::engine::exposure::Exposure;
use crate::engine::fast_progress::Monitor;
use crate::engine::fast_settings::FastSettings;
use crate::engine::node_grid::NodeGrid;
use crate::engine::paths::Paths;
use crate::engine::spectral_quadrature::{PRIMARY_ENERGIES, compressed};
use crate::transport::tally::Moments;
use crate::transport::tracking::Transport;

/// First two moments per history of the primary energy in every pixel, for an emitter with a spot of many mm.
pub(super) fn extrafocal_primary(
    exposure: &Exposure,
    paths: &Paths,
    settings: &FastSettings,
    monitor: &Monitor,
) -> Vec<Moments> {
    let transport = &exposure.transport;
    let detector = &transport.projection.detector;
    let projection = Projection {
        detector: wider_pixels(detector, blur_mm(transport)),
        ..transport.projection.clone()
    };
    let coarse = exposure.with_projection(&projection);
    let moments = primary_moments(
        &coarse,
        paths,
        compressed(&coarse, PRIMARY_ENERGIES),
        settings.samples_per_side,
        settings.dose_histories,
        monitor,
    );
    let to_pixels = NodeGrid::of_pixels(&projection.detector).to_pixels(detector);
    let share = detector.pixel_cm2() / projection.detector.pixel_cm2();
    let values = |of: fn(&Moments) -> f64| {
        let coarse: Vec<f64> = moments.iter().map(|moments| share * of(moments)).collect();
        // Next to dark regions the cubics may become negative.
        let values = to_pixels.values(&coarse).into_iter();
        values.map(|value| value.max(0.0)).collect::<Vec<_>>()
    };
    let squares = values(|moments| moments.square_kev2);
    let means = values(|moments| moments.mean_kev).into_iter();
    means
        .zip(squares)
        .map(|(mean_kev, square_kev2)| Moments {
            mean_kev,
            square_kev2,
        })
        .collect()
}

/// Width on the detector plane of the penumbra of an edge in the middle of the phantom, mm.
fn blur_mm(transport: &Transport) -> f64 {
    let projection = transport.projection;
    let device_from_ct = projection.ct_from_device.inverse();
    let corners = transport.tables.phantom.corners_ct();
    let middle_mm = corners.map(|corner| (device_from_ct * corner).z);
    let middle_mm = middle_mm.iter().sum::<f64>() / middle_mm.len() as f64;
    let magnification = projection.source_detector_mm / middle_mm.max(1.0);
    2.0 * transport.emitter.spot().reach_mm() * (magnification - 1.0).max(0.0)
}

/// Groups of pixels, at most `side_mm` wide, around the same centre, with at least one more on every side.
fn wider_pixels(detector: &Detector, side_mm: f64) -> Detector {
    let least = detector.columns.min(detector.rows);
    let binning = ((side_mm / detector.pixel_mm) as u32).clamp(1, least);
    Detector {
        columns: detector.columns.div_ceil(binning) + 2,
        rows: detector.rows.div_ceil(binning) + 2,
        pixel_mm: f64::from(binning) * detector.pixel_mm,
        ..*detector
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The centres of the outer pixels are beyond the detector, for any remainder.
    #[test]
    fn wider_pixels_surround_the_detector() {
        for (columns, rows, side_mm) in [
            (1_504, 1_504, 1.15),
            (24, 31, 9.0),
            (100, 1, 3.7),
            (5, 5, 0.01),
        ] {
            let detector = Detector::centred(columns, rows, 0.5);
            let wider = wider_pixels(&detector, side_mm);
            assert!(wider.pixel_mm <= side_mm.max(0.5) && wider.centre_mm == detector.centre_mm);
            let [inner, outer] = [detector.field(), wider.field()];
            for axis in 0..2 {
                let first_mm = outer.low_mm[axis] + 0.5 * wider.pixel_mm;
                assert!(
                    first_mm <= inner.low_mm[axis],
                    "{columns} x {rows}, {side_mm} mm"
                );
            }
        }
    }
}
