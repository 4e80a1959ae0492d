//! Memory check of an image before the first history.

use crate::beam::detector::Detector;
use crate::beam::projection_error::ProjectionError;

/// Peak number of bytes per pixel in either engine: sums or moments of four categories, noise, and the planes of
/// the result.
const BYTES_PER_PIXEL: usize = 256;

/// # Errors
/// [`ProjectionError::Memory`] if the operating system cannot allocate the memory for the image of a detector.
pub(crate) fn check(detector: &Detector) -> Result<(), ProjectionError> {
    let bytes = detector.pixels().saturating_mul(BYTES_PER_PIXEL);
    // Nothing is written, so no memory is used.
    let lent = Vec::<u8>::new().try_reserve_exact(bytes);
    lent.map_err(|_| ProjectionError::Memory {
        columns: detector.columns,
        rows: detector.rows,
        needed_gib: bytes as f64 / f64::from(1 << 30),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 2⁶⁴ pixels never fit into memory.
    #[test]
    fn an_image_that_fits_nowhere_is_refused() {
        let huge = Detector::centred(u32::MAX, u32::MAX, 1e-6);
        let refused = check(&huge).unwrap_err().to_string();
        assert!(
            refused.starts_with("the image of 4294967295 x 4294967295 pixels needs about"),
            "{refused}"
        );
        assert_eq!(check(&Detector::centred(100, 100, 1.0)), Ok(()));
    }
}
