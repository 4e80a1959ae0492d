//! Figures with captions, and the pictures in them.

use std::path::Path;

use image::RgbImage;
use maud::{Markup, html};
use ppa_dataset::files::FileError;

use super::error::QaError;
use crate::embedded::data_uri;

/// A figure, or nothing if there is no content.
pub(super) fn figure(caption: &str, content: Markup) -> Markup {
    html! {
        @if !content.0.is_empty() {
            figure { (content) figcaption { (caption) } }
        }
    }
}

/// A picture as part of the page; `root` is the dataset's folder, for the error.
pub(super) fn embedded(picture: &RgbImage, text: &str, root: &Path) -> Result<Markup, QaError> {
    let source = data_uri(picture);
    let source = source.map_err(|e| FileError::at("draw", root)(std::io::Error::other(e)))?;
    let (width, height) = picture.dimensions();
    Ok(html! { img alt=(text) width=(width) height=(height) src=(source); })
}
