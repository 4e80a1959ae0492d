//! The page on which a reader grades radiographs: one HTML file that works offline.

use std::io::Cursor;
use std::path::{Path, PathBuf};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use image::{GrayImage, ImageFormat};
use ppa_dataset::files::FileError;
use serde::Serialize;

use super::reader_case::ReaderCase;

/// Pictures on one page: radiographs of 448 x 448 pixels make about 30 MB, which any browser takes.
pub const PICTURES_PER_PAGE: usize = 200;

/// Why a page could not be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PageError {
    /// No radiograph to show.
    #[error("there is no radiograph to grade")]
    Empty,
    /// A radiograph cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// A radiograph cannot be decoded.
    #[error("cannot decode {}", path.display())]
    Image {
        /// The radiograph.
        path: PathBuf,
        /// What is wrong with it.
        source: image::ImageError,
    },
}

#[derive(Serialize)]
struct Picture<'a> {
    name: &'a str,
    /// 8-bit PNG, Base64.
    png: String,
}

/// Which of several pages.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PageNumber {
    /// Counted from 1.
    pub page: usize,
    /// Their number.
    pub of: usize,
}

/// A page of HTML that shows the radiographs one by one, takes a grade of each by key, and saves them as CSV with the
/// columns image (the name of the reader case), reader and grade.
///
/// All pictures have one window: black is 0 and white 65535 of the 16-bit radiographs. Nothing but names and pictures
/// gets into the page.
///
/// # Errors
/// [`PageError`] without radiographs, and naming one that cannot be read.
pub fn grading_page(
    root: &Path,
    shown: &[ReaderCase],
    number: PageNumber,
) -> Result<String, PageError> {
    if shown.is_empty() {
        return Err(PageError::Empty);
    }
    let picture = |reader_case: &ReaderCase| {
        let path = root.join(&reader_case.image);
        let bytes = ppa_core::regular_file::read(&path).map_err(FileError::at("read", &path))?;
        let image = image::load_from_memory_with_format(&bytes, ImageFormat::Png)
            .map_err(|source| PageError::Image { path, source })?
            .into_luma16();
        let narrow = image.pixels().map(|p| (p.0[0] >> 8) as u8).collect();
        let narrow = GrayImage::from_raw(image.width(), image.height(), narrow)
            .expect("there is a value for each pixel");
        let mut png = Cursor::new(Vec::new());
        narrow
            .write_to(&mut png, ImageFormat::Png)
            .expect("memory takes any picture");
        Ok(format_picture(&reader_case.name, png.get_ref()))
    };
    let pictures: Vec<String> = shown
        .iter()
        .map(picture)
        .collect::<Result<_, PageError>>()?;
    let (before, after) = include_str!("page.html")
        .split_once("/*PICTURES*/[]")
        .expect("the page has a place for its pictures");
    let page = format!("{before}[{}]{after}", pictures.join(",\n"));
    let PageNumber { page: n, of } = number;
    Ok(page.replacen("/*PAGE*/[1, 1]", &format!("[{n}, {of}]"), 1))
}

fn format_picture(name: &str, png: &[u8]) -> String {
    let png = STANDARD.encode(png);
    let json = serde_json::to_string(&Picture { name, png }).expect("texts are JSON");
    // So that no name ends the script that holds it.
    json.replace('<', "\\u003c")
}
