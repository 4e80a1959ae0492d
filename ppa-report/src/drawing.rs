//! Drawing of pictures for people.

use image::{Rgb, RgbImage};

/// Colour of text and lines.
pub(crate) const INK: Rgb<u8> = Rgb([235; 3]);

/// Writes ASCII text with its top left corner at (x, y), each dot `scale` pixels wide.
pub(crate) fn write_text(sheet: &mut RgbImage, text: &str, x: u32, y: u32, scale: u32) {
    for (i, byte) in text.bytes().filter(u8::is_ascii).enumerate() {
        let glyph = font8x8::legacy::BASIC_LEGACY[usize::from(byte)];
        for dot in 0..64 {
            let (column, row) = (dot % 8, dot / 8);
            if glyph[row as usize] >> column & 1 == 0 {
                continue;
            }
            for pixel in 0..scale * scale {
                let px = x + (i as u32 * 8 + column) * scale + pixel % scale;
                let py = y + row * scale + pixel / scale;
                if let Some(pixel) = sheet.get_pixel_mut_checked(px, py) {
                    *pixel = INK;
                }
            }
        }
    }
}

/// Fills the disc of a radius around (x, y).
pub(crate) fn fill_disc(sheet: &mut RgbImage, [x, y]: [f64; 2], radius: f64, colour: Rgb<u8>) {
    paint(sheet, [x, y], radius, |away| {
        (away <= radius).then_some(colour)
    });
}

/// Draws the circle of a radius around (x, y), `width` pixels wide.
pub(crate) fn draw_circle(
    sheet: &mut RgbImage,
    at: [f64; 2],
    radius: f64,
    width: f64,
    colour: Rgb<u8>,
) {
    let on_line = |away: f64| ((away - radius).abs() <= width / 2.0).then_some(colour);
    paint(sheet, at, radius + width, on_line);
}

/// Paints the pixels of a square around (x, y) by their distance from it.
fn paint(
    sheet: &mut RgbImage,
    [x, y]: [f64; 2],
    reach: f64,
    colour: impl Fn(f64) -> Option<Rgb<u8>>,
) {
    let range =
        |at: f64| (at - reach).floor().max(0.0) as u32..=(at + reach).ceil().max(0.0) as u32;
    for (px, py) in range(y).flat_map(|py| range(x).map(move |px| (px, py))) {
        let away = (f64::from(px) - x).hypot(f64::from(py) - y);
        if let (Some(colour), Some(pixel)) = (colour(away), sheet.get_pixel_mut_checked(px, py)) {
            *pixel = colour;
        }
    }
}
