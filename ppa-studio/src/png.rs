//! Pictures as PNG.

use std::io::Cursor;

use image::{DynamicImage, ImageError, ImageFormat};

/// Encodes a picture as a PNG file.
pub(crate) fn png(picture: impl Into<DynamicImage>) -> Result<Vec<u8>, ImageError> {
    let mut bytes = Cursor::new(Vec::new());
    picture.into().write_to(&mut bytes, ImageFormat::Png)?;
    Ok(bytes.into_inner())
}
