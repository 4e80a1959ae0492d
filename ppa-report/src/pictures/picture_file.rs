//! Pictures in files.

use std::io::{self, Cursor};
use std::path::Path;

use image::{ImageFormat, RgbImage};

use ppa_dataset::files::{FileError, write_whole};

/// Writes a picture as PNG, completely or not at all.
///
/// # Errors
/// [`FileError`] when the file cannot be written.
pub fn write_picture(path: &Path, picture: &RgbImage) -> Result<(), FileError> {
    let mut png = Cursor::new(Vec::new());
    let encoded = picture.write_to(&mut png, ImageFormat::Png);
    encoded.map_err(|error| FileError::at("write", path)(io::Error::other(error)))?;
    write_whole(path, png.get_ref())
}
