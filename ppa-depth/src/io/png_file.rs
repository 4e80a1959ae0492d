//! 16-bit grey PNG in millimetres.

use std::io::{self, BufReader};
use std::path::Path;

use ppa_core::whole_file;

use crate::camera::spec::CameraSpec;
use crate::image::{DepthError, DepthImage};

/// A colour type in words.
fn name(colour: png::ColorType) -> &'static str {
    match colour {
        png::ColorType::Grayscale => "grey",
        png::ColorType::GrayscaleAlpha => "grey with alpha",
        png::ColorType::Rgb => "RGB",
        png::ColorType::Rgba => "RGB with alpha",
        png::ColorType::Indexed => "palette",
    }
}

impl DepthImage {
    /// Writes a 16-bit grey PNG in whole millimetres, 0 for nothing, atomically.
    ///
    /// Returns the number of pixels too far for 16 bits (65.535 m), which are 0 in the file.
    ///
    /// # Errors
    /// [`DepthError::Write`] names the file; [`DepthError::TooFar`] when no depth fits into it; [`DepthError::Length`] for a
    /// buffer that does not fit the size.
    pub fn write_png(&self, path: &Path) -> Result<usize, DepthError> {
        self.check_length()?;
        let rounded = self.to_u16();
        if rounded.too_far > 0 && rounded.too_far == self.valid_pixels() {
            return Err(DepthError::TooFar {
                path: path.into(),
                pixels: rounded.too_far,
            });
        }
        let bytes: Vec<u8> = rounded
            .z_mm
            .iter()
            .flat_map(|z_mm| z_mm.to_be_bytes())
            .collect();
        // Noise does not compress: the best setting takes fourteen times as long for a tenth of the size.
        let (grey, fast) = (png::ColorType::Grayscale, png::Compression::Fast);
        self.write_pixels(path, &bytes, (grey, png::BitDepth::Sixteen), fast)?;
        Ok(rounded.too_far)
    }

    /// Writes a PNG of the size of this image from the bytes of its pixels, atomically.
    pub(crate) fn write_pixels(
        &self,
        path: &Path,
        bytes: &[u8],
        (colour, depth): (png::ColorType, png::BitDepth),
        compression: png::Compression,
    ) -> Result<(), DepthError> {
        whole_file::write_with(path, |writer| {
            let mut encoder = png::Encoder::new(writer, self.width, self.height);
            encoder.set_color(colour);
            encoder.set_depth(depth);
            encoder.set_compression(compression);
            let mut image = encoder.write_header()?;
            image.write_image_data(bytes)?;
            Ok(image.finish()?)
        })
        .map_err(|source| DepthError::Write {
            path: path.into(),
            source,
        })
    }

    /// Reads a 16-bit grey PNG in millimetres.
    ///
    /// # Errors
    /// [`DepthError::Read`] for a missing or broken file, [`DepthError::PixelFormat`] for any other kind of PNG.
    pub fn read_png(path: &Path) -> Result<Self, DepthError> {
        let broken = |source: io::Error| DepthError::Read {
            path: path.into(),
            source,
        };
        let file = ppa_core::regular_file::open(path).map_err(broken)?;
        let mut reader = png::Decoder::new(BufReader::new(file))
            .read_info()
            .map_err(|e| broken(e.into()))?;
        let (colour, depth) = reader.output_color_type();
        if (colour, depth) != (png::ColorType::Grayscale, png::BitDepth::Sixteen) {
            return Err(DepthError::PixelFormat {
                path: path.into(),
                found: format!("{}-bit {}", depth as u8, name(colour)),
            });
        }
        let (width, height) = reader.info().size();
        // A header of a few bytes can claim more than there is memory.
        if width.max(height) > CameraSpec::MAX_SIDE {
            let claim =
                format!("{width} x {height} pixels, expected at most 16384 along each side");
            return Err(broken(io::Error::other(claim)));
        }
        let too_large = || broken(io::Error::other("the image is too large for this machine"));
        let mut bytes = vec![0; reader.output_buffer_size().ok_or_else(too_large)?];
        reader
            .next_frame(&mut bytes)
            .map_err(|e| broken(e.into()))?;
        let z_mm = bytes
            .as_chunks::<2>()
            .0
            .iter()
            .map(|&pair| f32::from(u16::from_be_bytes(pair)))
            .collect();
        Ok(Self {
            width,
            height,
            z_mm,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_png_holds_every_millimetre_exactly() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("depth.png");
        let mut image = DepthImage {
            width: 256,
            height: 256,
            z_mm: (0..65_536).map(|z| z as f32).collect(),
        };
        image.z_mm[7] = 70_000.0;
        assert_eq!(image.write_png(&path).unwrap(), 1);
        let far = DepthImage {
            z_mm: vec![0.0, 70_000.0],
            width: 2,
            height: 1,
        };
        let found = far.write_png(&folder.path().join("far.png"));
        assert!(
            matches!(found, Err(DepthError::TooFar { pixels: 1, .. })),
            "{found:?}"
        );
        image.z_mm[7] = 0.0;
        assert_eq!(DepthImage::read_png(&path).unwrap(), image);
        assert_eq!(
            std::fs::read_dir(folder.path()).unwrap().count(),
            1,
            "nothing but the image remains"
        );
    }

    #[test]
    fn bad_files_and_folders_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let grey8 = folder.path().join("grey8.png");
        let mut encoder = png::Encoder::new(std::fs::File::create(&grey8).unwrap(), 1, 1);
        encoder.set_color(png::ColorType::Grayscale);
        encoder
            .write_header()
            .unwrap()
            .write_image_data(&[5])
            .unwrap();
        assert!(matches!(
            DepthImage::read_png(&grey8),
            Err(DepthError::PixelFormat { .. })
        ));
        std::fs::write(&grey8, b"no image").unwrap();
        assert!(matches!(
            DepthImage::read_png(&grey8),
            Err(DepthError::Read { .. })
        ));
        // The header is checked before memory is allocated.
        let wide = folder.path().join("wide.png");
        let mut encoder = png::Encoder::new(std::fs::File::create(&wide).unwrap(), 20_000, 1);
        encoder.set_depth(png::BitDepth::Sixteen);
        let mut row = encoder.write_header().unwrap();
        row.write_image_data(&[0; 40_000]).unwrap();
        row.finish().unwrap();
        let refused = DepthImage::read_png(&wide).unwrap_err();
        let why = std::error::Error::source(&refused).unwrap().to_string();
        assert!(why.contains("20000 x 1 pixels"), "{why}");
        let missing = folder.path().join("no folder/depth.png");
        assert!(matches!(
            DepthImage::empty(2, 2).write_png(&missing),
            Err(DepthError::Write { .. })
        ));
        let torn = DepthImage {
            width: 2,
            height: 2,
            z_mm: vec![1.0],
        };
        assert!(matches!(
            torn.write_png(&folder.path().join("torn.png")),
            Err(DepthError::Length { .. })
        ));
        assert!(!folder.path().join("torn.png").exists());
    }
}
