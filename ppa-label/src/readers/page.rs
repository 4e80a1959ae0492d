//! The page on which a reader grades radiographs: one HTML file that works offline.

use std::io::Cursor;
use std::path::{Path, PathBuf};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use image::{GrayImage, ImageFormat};
use ppa_dataset::files::{FileError, hex};
use serde::Serialize;
use sha2::{Digest, Sha256};

use super::reader_case::ReaderCase;

/// Pictures on one page: radiographs of 448 x 448 pixels give about 30 MB, which any browser can open.
pub const PICTURES_PER_PAGE: usize = 200;

/// Why a picture or a page could not be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PageError {
    /// No radiograph to grade.
    #[error("there is no radiograph to grade")]
    Empty,
    /// A radiograph cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// A radiograph has changed since the dataset was made.
    #[error(
        "{} has changed since the dataset was made: its hash is {found}, expected {expected}",
        path.display()
    )]
    Changed {
        /// The radiograph.
        path: PathBuf,
        /// SHA-256 of the file.
        found: String,
        /// SHA-256 in the lists of the dataset, and in the key.
        expected: String,
    },
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

/// Number of one of several pages.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PageNumber {
    /// The page, counted from 1.
    pub page: usize,
    /// Number of pages.
    pub of: usize,
}

/// The picture of a reader case as an 8-bit PNG. All pictures have the same window: black is 0 and white 65535 of the 16-bit
/// radiographs. The file contains only the pixels.
///
/// # Errors
/// [`PageError`] naming a radiograph that cannot be read or has changed.
pub fn reader_picture(root: &Path, reader_case: &ReaderCase) -> Result<Vec<u8>, PageError> {
    let path = root.join(&reader_case.image);
    let bytes = ppa_core::regular_file::read(&path).map_err(FileError::at("read", &path))?;
    let found = hex(&Sha256::digest(&bytes));
    if found != reader_case.sha256 {
        let expected = reader_case.sha256.clone();
        return Err(PageError::Changed {
            path,
            found,
            expected,
        });
    }
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
    Ok(png.into_inner())
}

/// An HTML page that shows the radiographs one by one, takes a grade of each by key, and saves them as CSV with the
/// columns image (the name of the reader case), reader and grade.
///
/// The page contains only names and the pictures of [`reader_picture`].
///
/// # Errors
/// [`PageError`] if there are no radiographs, or naming one that cannot be read or has changed.
pub fn grading_page(
    root: &Path,
    shown: &[ReaderCase],
    number: PageNumber,
) -> Result<String, PageError> {
    if shown.is_empty() {
        return Err(PageError::Empty);
    }
    let picture = |reader_case: &ReaderCase| {
        let png = reader_picture(root, reader_case)?;
        Ok(format_picture(&reader_case.name, &png))
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
    // A name must not end the script that contains it.
    json.replace('<', "\\u003c")
}
