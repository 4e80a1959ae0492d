//! Previews of depth images in false colour, 8 bits.

use std::path::Path;

use crate::image::{DepthError, DepthImage};

/// A depth in false colour (8 bits of red, green and blue): `range` from near, red, to far, blue; black where it is not above 0.
pub fn false_colour(z_mm: f64, [near_mm, far_mm]: [f64; 2]) -> [u8; 3] {
    if z_mm > 0.0 {
        let t = ((far_mm - z_mm) / (far_mm - near_mm).max(1.0)).clamp(0.0, 1.0);
        // The low end of the scale is nearly black, which means invalid here.
        colorous::TURBO.eval_continuous(0.1 + 0.9 * t).into_array()
    } else {
        [0; 3]
    }
}

impl DepthImage {
    /// Writes a PNG in false colour: near red, far blue, nothing black; from the 1st to the 99th percentile of the depths.
    ///
    /// # Errors
    /// [`DepthError::Write`] names the file; [`DepthError::Length`] for a buffer that does not fit the size;
    /// [`DepthError::NothingVisible`] for an image without depths.
    pub fn write_preview(&self, path: &Path) -> Result<(), DepthError> {
        self.check_length()?;
        self.require_visible()?;
        let [near, far] = self.percentiles([0.01, 0.99]);
        let range = [near, far].map(f64::from);
        let pixels = self
            .z_mm
            .iter()
            .flat_map(|&z_mm| false_colour(z_mm.into(), range));
        let bytes: Vec<u8> = pixels.collect();
        let rgb = (png::ColorType::Rgb, png::BitDepth::Eight);
        self.write_pixels(path, &bytes, rgb, png::Compression::Balanced)
    }

    fn percentiles(&self, shares: [f64; 2]) -> [f32; 2] {
        let mut depths: Vec<f32> = self.z_mm.iter().copied().filter(|z| *z > 0.0).collect();
        depths.sort_unstable_by(f32::total_cmp);
        shares.map(|share| depths[(share * (depths.len() - 1) as f64).round() as usize])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn near_is_red_far_is_blue_and_nothing_black() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("preview.png");
        let image = DepthImage {
            width: 3,
            height: 1,
            z_mm: vec![900.0, 0.0, 1200.0],
        };
        image.write_preview(&path).unwrap();
        let file = std::io::BufReader::new(std::fs::File::open(&path).unwrap());
        let mut reader = png::Decoder::new(file).read_info().unwrap();
        let mut rgb = [0; 9];
        reader.next_frame(&mut rgb).unwrap();
        let [[r, _, b], nothing, [r_far, _, b_far]] = *rgb.as_chunks::<3>().0 else {
            unreachable!()
        };
        assert!(r > b && b_far > r_far && nothing == [0; 3]);
        assert!(matches!(
            DepthImage::empty(2, 2).write_preview(&path),
            Err(DepthError::NothingVisible { .. })
        ));
    }
}
