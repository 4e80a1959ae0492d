//! Shapes as pixels.

use std::io::Cursor;

use font8x8::UnicodeFonts;
use image::{ImageFormat, Rgb, RgbImage};

use super::{COLOURS, SIZE, Shape, tint};

pub struct Page(RgbImage);

impl Page {
    pub fn new() -> Self {
        let [width, height] = SIZE.map(|pixels| pixels as u32);
        Self(RgbImage::from_pixel(width, height, Rgb([255; 3])))
    }

    pub fn draw(&mut self, shape: Shape) {
        match shape {
            Shape::Line(from, to, of) => {
                let [dx, dy] = [to[0] - from[0], to[1] - from[1]];
                let steps = dx.abs().max(dy.abs()).ceil().max(1.0);
                let radius = i32::from(of.is_some());
                for i in 0..=steps as i32 {
                    let share = f64::from(i) / steps;
                    self.square([from[0] + share * dx, from[1] + share * dy], radius, of);
                }
            }
            Shape::Tile(from, to, share) => {
                let [from, to] = [from, to].map(|end| end.map(|x| x.round() as u32));
                for y in from[1].min(to[1])..from[1].max(to[1]) {
                    for x in from[0].min(to[0])..from[0].max(to[0]) {
                        self.0.put_pixel(x, y, Rgb(tint(share)));
                    }
                }
            }
            Shape::Dot(at, of) => self.square(at, 2, Some(of)),
            Shape::Text([x, y], text, of) => {
                let left = x - 4.0 * text.chars().count() as f64;
                for (place, letter) in text.chars().enumerate() {
                    let rows = font8x8::BASIC_FONTS.get(letter).unwrap_or([0; 8]);
                    for (row, bits) in rows.into_iter().enumerate() {
                        for column in (0..8).filter(|column| bits >> column & 1 == 1) {
                            let x = left + (8 * place + column) as f64;
                            self.square([x, y - 4.0 + row as f64], 0, of);
                        }
                    }
                }
            }
        }
    }

    /// Fills a square of 2 · radius + 1 pixels, as far as it lies on the page; no colour is black.
    fn square(&mut self, at: [f64; 2], radius: i32, of: Option<usize>) {
        let [x, y] = at.map(|place| place.round() as i32);
        for y in (y - radius).max(0)..=(y + radius).min(SIZE[1] - 1) {
            for x in (x - radius).max(0)..=(x + radius).min(SIZE[0] - 1) {
                let colour = of.map_or([0; 3], |i| COLOURS[i]);
                self.0.put_pixel(x as u32, y as u32, Rgb(colour));
            }
        }
    }

    pub fn finish(self) -> Vec<u8> {
        let mut bytes = Cursor::new(Vec::new());
        let written = self.0.write_to(&mut bytes, ImageFormat::Png);
        written.expect("memory takes every image");
        bytes.into_inner()
    }
}
