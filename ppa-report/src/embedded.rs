//! Pictures embedded in HTML pages.

use std::io::Cursor;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use image::{EncodableLayout, ImageBuffer, ImageFormat, ImageResult, PixelWithColorType};

/// A picture as a data URI for the `src` of an `img` element.
pub(crate) fn data_uri<P>(picture: &ImageBuffer<P, Vec<P::Subpixel>>) -> ImageResult<String>
where
    P: PixelWithColorType,
    [P::Subpixel]: EncodableLayout,
{
    let mut png = Cursor::new(Vec::new());
    picture.write_to(&mut png, ImageFormat::Png)?;
    let text = STANDARD.encode(png.into_inner());
    Ok(format!("data:image/png;base64,{text}"))
}
