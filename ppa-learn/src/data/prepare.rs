//! Region of interest, size and scale: the preparation shared by training and evaluation.

use ppa_core::Roi;

use super::error::DataError;
use super::raster::Raster;

/// Depth in mm at which depths are clipped; it becomes 1.
pub const RANGE_MM: u16 = 1500;

/// Checks that at least one pixel of a region of interest is inside an image of `width` x `height`.
///
/// # Errors
/// [`DataError::RoiOutside`] if none is.
pub fn check_roi(roi: &Roi, width: usize, height: usize) -> Result<(), DataError> {
    let &Roi {
        x_start,
        y_start,
        size,
    } = roi;
    match size > 0 && (x_start as usize) < width && (y_start as usize) < height {
        true => Ok(()),
        false => Err(DataError::RoiOutside {
            x: x_start,
            y: y_start,
            size,
            width,
            height,
        }),
    }
}

/// Returns the side of a prepared image for a network whose input has `side` columns and rows: 1.2 times `side`, rounded down.
pub fn prepared_side(side: usize) -> usize {
    side * 6 / 5
}

/// Crops a depth image (mm, 0 invalid) to the region and resizes it to [`prepared_side`], still in mm; optionally mirrors it left to right.
///
/// # Errors
/// [`DataError::RoiOutside`] if no pixel of the region is in the image.
///
/// # Panics
/// If `side` is 0.
pub fn prepare(
    depth_mm: &Raster<u16>,
    roi: Roi,
    mirrored: bool,
    side: usize,
) -> Result<Raster<u16>, DataError> {
    check_roi(&roi, depth_mm.width(), depth_mm.height())?;
    let [x, y, size] = [roi.x_start, roi.y_start, roi.size].map(|pixels| pixels as usize);
    let region = depth_mm.crop(x, y, size, size);
    let mut region = region.expect("a pixel of the region lies in the image");
    if mirrored {
        region = region.mirrored();
    }
    Ok(region.resized(prepared_side(side), prepared_side(side)))
}

/// Converts depth in mm to a share of [`RANGE_MM`] in [0, 1]; invalid pixels stay 0.
pub(super) fn share_of_range(prepared_mm: &Raster<u16>) -> Raster<f32> {
    prepared_mm.map(|mm| f32::from(mm.min(RANGE_MM)) / f32::from(RANGE_MM))
}

/// Converts a share of the range to a network input value.
pub(super) fn network_value(share: f32) -> f32 {
    share - 0.5
}

/// Converts a prepared image to the network's input in evaluation, `side * side` values in [−0.5, 0.5].
pub fn evaluation_input(prepared_mm: &Raster<u16>, side: usize) -> Raster<f32> {
    share_of_range(&prepared_mm.resized(side, side)).map(network_value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_papers_sides() {
        assert_eq!(prepared_side(336), 403);
        assert_eq!([5, 96, 1].map(prepared_side), [6, 115, 1]);
    }

    #[test]
    fn depths_are_clipped_and_shifted_and_invalid_ones_stay_least() {
        let image = Raster::new(2, 2, vec![0, 750, 1500, 40_000]).unwrap();
        let whole = Roi {
            x_start: 0,
            y_start: 0,
            size: 2,
        };
        let prepared = prepare(&image, whole, false, 5).unwrap();
        assert_eq!((prepared.width(), prepared.height()), (6, 6));
        assert_eq!(prepared.values()[..6], [0, 0, 0, 750, 750, 750]);
        let input = evaluation_input(&prepared, 2);
        assert_eq!(input.values(), [-0.5, 0.0, 0.5, 0.5]);
    }

    #[test]
    fn a_mirrored_image_is_prepared_as_its_mirrored_region() {
        let image = Raster::new(7, 4, (0..28).map(|i| i * i).collect()).unwrap();
        let flipped = image.mirrored();
        // The right border cuts the second region, so its mirror image begins at the left border.
        for (x_start, size, mirrored_x, cut) in [(1, 3, 3, 3), (4, 4, 0, 3)] {
            let roi = |x_start, size| Roi {
                x_start,
                y_start: 1,
                size,
            };
            let found = prepare(&image, roi(x_start, size), true, 5).unwrap();
            let expected = flipped.crop(mirrored_x, 1, cut, 3).unwrap();
            assert_eq!(found, expected.resized(6, 6));
        }
    }

    #[test]
    fn a_region_outside_is_named() {
        let image = Raster::new(4, 3, vec![0; 12]).unwrap();
        let beyond = Roi {
            x_start: 4,
            y_start: 0,
            size: 9,
        };
        let error = prepare(&image, beyond, false, 5).unwrap_err().to_string();
        assert_eq!(
            error,
            "the region of 9 x 9 pixels from column 4 and row 0 lies outside the image of 4 x 3"
        );
    }
}
