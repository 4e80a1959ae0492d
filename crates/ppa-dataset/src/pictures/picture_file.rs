//! Pictures in files.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use image::RgbImage;

use crate::files::{FileError, write_whole};

/// Keyword and text in every picture, by which it is known as one that can be drawn again.
const MARK: [&str; 2] = ["Software", "ppa picture"];

/// Writes a picture as PNG, whole or not at all.
///
/// # Errors
/// [`FileError`] when the file cannot be written.
pub fn write_picture(path: &Path, picture: &RgbImage) -> Result<(), FileError> {
    let png = encoded(picture).map_err(|error| FileError::at("write", path)(error.into()))?;
    write_whole(path, &png)
}

/// Whether a file is a picture that [`write_picture`] wrote.
pub fn is_own_picture(path: &Path) -> bool {
    let Ok(file) = File::open(path) else {
        return false;
    };
    let reader = png::Decoder::new(BufReader::new(file)).read_info();
    reader.is_ok_and(|reader| {
        let texts = &reader.info().uncompressed_latin1_text;
        texts
            .iter()
            .any(|chunk| [&chunk.keyword[..], &chunk.text[..]] == MARK)
    })
}

fn encoded(picture: &RgbImage) -> Result<Vec<u8>, png::EncodingError> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, picture.width(), picture.height());
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    let [keyword, text] = MARK.map(str::to_owned);
    encoder.add_text_chunk(keyword, text)?;
    let mut writer = encoder.write_header()?;
    writer.write_image_data(picture.as_raw())?;
    writer.finish()?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_pictures_of_this_program_are_known() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        let picture = RgbImage::from_fn(7, 5, |x, y| image::Rgb([x as u8, y as u8, 9]));
        write_picture(&path("own.png"), &picture).unwrap();
        assert!(is_own_picture(&path("own.png")));
        assert_eq!(image::open(path("own.png")).unwrap().into_rgb8(), picture);
        picture.save(path("other.png")).unwrap();
        std::fs::write(path("text.png"), "Software ppa picture").unwrap();
        for name in ["other.png", "text.png", "none.png"] {
            assert!(!is_own_picture(&path(name)), "{name}");
        }
    }
}
