//! Pixels as a backend of `plotters`, with the letters of `font8x8` instead of the system's fonts.

use std::convert::Infallible;

use font8x8::UnicodeFonts;
use image::{Rgb, RgbImage, imageops};
use plotters::coord::Shift;
use plotters::drawing::{DrawingArea, DrawingAreaErrorKind, IntoDrawingArea};
use plotters::style::text_anchor::{HPos, VPos};
use plotters_backend::{
    BackendColor, BackendCoord, BackendTextStyle, DrawingBackend, DrawingErrorKind,
};

type Drawn = Result<(), DrawingErrorKind<Infallible>>;

/// Enlargement of the canvas, which is scaled down afterwards, since `plotters` draws on whole pixels.
pub const SCALE: i32 = 4;
/// Font size on the canvas. The letters of [`Pixels`] have one size, 8 × 8 dots of [`SCALE`].
pub const FONT: i32 = 15 * SCALE;

/// Draws a picture of the given size; `draw` gets a canvas [`SCALE`] times as large.
pub fn picture(
    size: [u32; 2],
    draw: impl FnOnce(&DrawingArea<Pixels, Shift>) -> Result<(), DrawingAreaErrorKind<Infallible>>,
) -> RgbImage {
    let [width, height] = size.map(|side| side * SCALE as u32);
    let mut canvas = RgbImage::new(width, height);
    draw(&Pixels(&mut canvas).into_drawing_area()).expect("an image takes every shape");
    imageops::thumbnail(&canvas, size[0], size[1])
}

/// An image to draw on.
pub struct Pixels<'a>(pub &'a mut RgbImage);

impl DrawingBackend for Pixels<'_> {
    type ErrorType = Infallible;

    fn get_size(&self) -> (u32, u32) {
        self.0.dimensions()
    }

    fn ensure_prepared(&mut self) -> Drawn {
        Ok(())
    }

    fn present(&mut self) -> Drawn {
        Ok(())
    }

    fn draw_pixel(&mut self, (x, y): BackendCoord, colour: BackendColor) -> Drawn {
        let place = u32::try_from(x).ok().zip(u32::try_from(y).ok());
        if let Some(pixel) = place.and_then(|(x, y)| self.0.get_pixel_mut_checked(x, y)) {
            let (r, g, b) = colour.rgb;
            let mix = |below: u8, above: u8| {
                let [below, above] = [below, above].map(f64::from);
                (below + colour.alpha * (above - below)).round() as u8
            };
            let Rgb([red, green, blue]) = *pixel;
            *pixel = Rgb([mix(red, r), mix(green, g), mix(blue, b)]);
        }
        Ok(())
    }

    fn draw_text<S: BackendTextStyle>(
        &mut self,
        text: &str,
        style: &S,
        place: BackendCoord,
    ) -> Drawn {
        let (width, height) = self.estimate_text_size(text, style)?;
        let left = match style.anchor().h_pos {
            HPos::Left => 0,
            HPos::Center => -(width as i32) / 2,
            HPos::Right => -(width as i32),
        };
        let top = match style.anchor().v_pos {
            VPos::Top => 0,
            VPos::Center => -(height as i32) / 2,
            VPos::Bottom => -(height as i32),
        };
        for (n, letter) in text.chars().enumerate() {
            let rows = font8x8::BASIC_FONTS.get(letter);
            let rows = rows
                .or_else(|| font8x8::LATIN_FONTS.get(letter))
                .unwrap_or([0; 8]);
            let set = (0..64).filter(|bit| rows[bit / 8] >> (bit % 8) & 1 == 1);
            for bit in set {
                let (column, row) = (8 * n + bit % 8, bit / 8);
                for pixel in 0..SCALE * SCALE {
                    let x = left + column as i32 * SCALE + pixel % SCALE;
                    let y = top + row as i32 * SCALE + pixel / SCALE;
                    let (x, y) = style.transform().transform(x, y);
                    self.draw_pixel((place.0 + x, place.1 + y), style.color())?;
                }
            }
        }
        Ok(())
    }

    fn estimate_text_size<S: BackendTextStyle>(
        &self,
        text: &str,
        _: &S,
    ) -> Result<(u32, u32), DrawingErrorKind<Infallible>> {
        let side = 8 * SCALE as u32;
        Ok((side * text.chars().count() as u32, side))
    }
}
