//! Columns and rows of an image, from its header.

use std::io::BufReader;
use std::path::Path;

use image::codecs::png::PngDecoder;
use image::{ColorType, ImageDecoder};
use ppa_dataset::FileError;
use ppa_dataset::published::ImageFileError;

use super::error::DataError;

/// Returns the columns and rows of a single-channel 16-bit PNG without reading pixels.
pub fn size_of(path: &Path) -> Result<[usize; 2], DataError> {
    let unreadable = |source| FileError {
        action: "read",
        path: path.to_owned(),
        source,
    };
    let file = ppa_core::regular_file::open(path)
        .map_err(|source| ImageFileError::File(unreadable(source)))?;
    let header = PngDecoder::new(BufReader::new(file));
    let header = header.map_err(|source| ImageFileError::Damaged {
        path: path.to_owned(),
        source,
    })?;
    match header.color_type() {
        ColorType::L16 => {
            let (width, height) = header.dimensions();
            Ok([width as usize, height as usize])
        }
        other => Err(DataError::Image(ImageFileError::pixels(path, other))),
    }
}
