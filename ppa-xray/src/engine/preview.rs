//! Simplifications for a preview of a fast exposure: larger pixels, fewer histories for the scatter.

use crate::beam::detector::Detector;
use crate::beam::receptor::Receptor;
use crate::engine::fast_settings::FastSettings;

/// Smallest number of pixels along the shorter side of a preview, unless the image has fewer.
const LEAST_PIXELS: u32 = 96;

/// Largest number of primary rays per pixel side.
const SAMPLES_PER_SIDE: u32 = 2;

/// Ratio of the scatter histories of an image to those of its preview.
const HISTORIES: u64 = 32;

/// The settings with fewer histories for the scatter and fewer rays.
pub(super) fn settings(image: &FastSettings) -> FastSettings {
    FastSettings {
        scatter_histories: (image.scatter_histories / HISTORIES).max(1),
        samples_per_side: image.samples_per_side.min(SAMPLES_PER_SIDE),
        ..*image
    }
}

/// The receptor with gains of larger pixels, which vary like means of those of the image, and with the mean of a stationary grid, whose
/// lines would cause different moiré in larger pixels.
pub(super) fn receptor(image: &Receptor, detector: &Detector) -> Receptor {
    let mut receptor = image.clone();
    receptor.gain_error /= f64::from(binning(detector));
    if let Some(grid) = &mut receptor.grid {
        grid.moving |= binning(detector) > 1;
    }
    receptor
}

/// Pixels of the image along the side of a pixel of its preview.
fn binning(image: &Detector) -> u32 {
    (image.columns.min(image.rows) / LEAST_PIXELS).max(1)
}

/// The detector with larger pixels; both have the same corner at low x and y.
pub(super) fn detector(image: &Detector) -> Detector {
    let binning = binning(image);
    let [columns, rows] = [image.columns, image.rows].map(|count| count.div_ceil(binning));
    let pixel_mm = image.pixel_mm * f64::from(binning);
    let beyond_mm =
        |binned: u32, count: u32| f64::from(binned) * pixel_mm - f64::from(count) * image.pixel_mm;
    let [x, y] = image.centre_mm;
    Detector {
        columns,
        rows,
        pixel_mm,
        centre_mm: [
            x + 0.5 * beyond_mm(columns, image.columns),
            y + 0.5 * beyond_mm(rows, image.rows),
        ],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_preview_keeps_the_corner_of_the_detector() {
        let detector = Detector {
            centre_mm: [7.0, -3.0],
            ..Detector::centred(385, 402, 0.5)
        };
        let preview = super::detector(&detector);
        assert_eq!((preview.columns, preview.rows), (97, 101));
        assert_eq!(preview.field().low_mm, detector.field().low_mm);
        let few = Detector::centred(20, 90, 1.0);
        assert_eq!(super::detector(&few), few);
    }
}
