//! Single-channel 16-bit images.

use std::io::Cursor;
use std::path::{Path, PathBuf};

use image::{ColorType, DynamicImage, ImageFormat, ImageReader};

use crate::files::FileError;

/// Why a file is not a single-channel 16-bit image.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImageFileError {
    /// The file cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// The file is not a complete PNG.
    #[error("{} is not a complete PNG file", path.display())]
    Damaged {
        /// The image.
        path: PathBuf,
        /// What is wrong with it.
        source: image::ImageError,
    },
    /// Its pixels are not 16-bit grey.
    #[error("{} holds {found} pixels, expected 16-bit grey", path.display())]
    Pixels {
        /// The image.
        path: PathBuf,
        /// Channels and bits, such as `8-bit RGB`.
        found: String,
    },
}

impl ImageFileError {
    /// The error of an image whose pixels are not 16-bit grey.
    pub fn pixels(path: &Path, found: ColorType) -> Self {
        let channels = match found.channel_count() {
            1 => "grey",
            2 => "grey with alpha",
            3 => "RGB",
            _ => "RGB with alpha",
        };
        let bits = 8 * found.bytes_per_pixel() / found.channel_count();
        Self::Pixels {
            path: path.to_owned(),
            found: format!("{bits}-bit {channels}"),
        }
    }
}

/// A depth image (mm, 0 invalid) or a radiograph for viewing.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct GrayImage16 {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Row by row from the top left corner.
    pub pixels: Vec<u16>,
}

impl GrayImage16 {
    /// Reads a PNG.
    ///
    /// # Errors
    /// [`ImageFileError`] naming the file; images with fewer bits or colour are not converted.
    pub fn read(path: &Path) -> Result<Self, ImageFileError> {
        let bytes = ppa_core::regular_file::read(path).map_err(FileError::at("read", path))?;
        Self::decode(&bytes, path)
    }

    /// Reads the bytes of the PNG at `path`.
    pub(crate) fn decode(bytes: &[u8], path: &Path) -> Result<Self, ImageFileError> {
        let reader = ImageReader::with_format(Cursor::new(bytes), ImageFormat::Png);
        let decoded = reader.decode().map_err(|source| ImageFileError::Damaged {
            path: path.to_owned(),
            source,
        })?;
        match decoded {
            DynamicImage::ImageLuma16(image) => Ok(Self {
                width: image.width(),
                height: image.height(),
                pixels: image.into_raw(),
            }),
            other => Err(ImageFileError::pixels(path, other.color())),
        }
    }
}
