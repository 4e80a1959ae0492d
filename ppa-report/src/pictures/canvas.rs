//! A picture to draw on: rectangles, lines, discs and text, blended by the share of a pixel that they cover.
//!
//! Pixel (i, j) covers i..i + 1 to the right and j..j + 1 downwards; its centre is (i + 0.5, j + 0.5).

use font8x8::UnicodeFonts;
use image::{Rgb, RgbImage};

/// A colour, sRGB.
pub(super) type Colour = [u8; 3];

/// A part of the picture, pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Rect {
    pub(super) x: u32,
    pub(super) y: u32,
    pub(super) width: u32,
    pub(super) height: u32,
}

impl Rect {
    /// Its centre.
    pub(super) fn middle(self) -> [f64; 2] {
        [
            f64::from(self.x) + 0.5 * f64::from(self.width),
            f64::from(self.y) + 0.5 * f64::from(self.height),
        ]
    }

    /// Its first and one past its last column and row.
    pub(super) fn ends(self) -> [[u32; 2]; 2] {
        [
            [self.x, self.x + self.width],
            [self.y, self.y + self.height],
        ]
    }
}

/// Edge length of a glyph at scale 1, pixels.
pub(super) const GLYPH: u32 = 8;

/// A picture; everything drawn stays inside [`Canvas::clip`].
pub(super) struct Canvas {
    image: RgbImage,
    clip: Rect,
}

impl Canvas {
    pub(super) fn new(width: u32, height: u32, colour: Colour) -> Self {
        Self {
            image: RgbImage::from_pixel(width, height, Rgb(colour)),
            clip: Rect {
                x: 0,
                y: 0,
                width,
                height,
            },
        }
    }

    pub(super) fn into_image(self) -> RgbImage {
        self.image
    }

    /// Restricts drawing to a part of the picture.
    pub(super) fn within<T>(&mut self, rect: Rect, draw: impl FnOnce(&mut Self) -> T) -> T {
        let outer = std::mem::replace(&mut self.clip, rect);
        let drawn = draw(self);
        self.clip = outer;
        drawn
    }

    /// Mixes a colour into a pixel; `share` of 1 replaces it.
    pub(super) fn blend(&mut self, x: u32, y: u32, colour: Colour, share: f64) {
        let [[left, right], [top, bottom]] = self.clip.ends();
        if !(left..right).contains(&x) || !(top..bottom).contains(&y) {
            return;
        }
        if let Some(Rgb(pixel)) = self.image.get_pixel_mut_checked(x, y) {
            *pixel = mixed(*pixel, colour, share);
        }
    }

    pub(super) fn fill(&mut self, rect: Rect, colour: Colour) {
        let [[left, right], [top, bottom]] = rect.ends();
        for (x, y) in (top..bottom).flat_map(|y| (left..right).map(move |x| (x, y))) {
            self.blend(x, y, colour, 1.0);
        }
    }

    /// A straight line, `width` pixels wide, from one point to another.
    pub(super) fn line(&mut self, from: [f64; 2], to: [f64; 2], width: f64, colour: Colour) {
        self.stroke(from, to, width, |_| Some((colour, 1.0)));
    }

    /// A line whose colour and opacity depend on the relative position from `from` (0) to `to` (1).
    pub(super) fn stroke(
        &mut self,
        from: [f64; 2],
        to: [f64; 2],
        width: f64,
        colour: impl Fn(f64) -> Option<(Colour, f64)>,
    ) {
        let reach = 0.5 * width + 1.0;
        let Some([first, last]) = clipped(from, to, self.clip, reach) else {
            return;
        };
        let along = [to[0] - from[0], to[1] - from[1]];
        let length = along[0].hypot(along[1]);
        if length == 0.0 {
            return;
        }
        let at = |t: f64| [from[0] + t * along[0], from[1] + t * along[1]];
        let (a, b) = (at(first), at(last));
        let (major, minor) = if along[0].abs() >= along[1].abs() {
            (0, 1)
        } else {
            (1, 0)
        };
        // Half the length of the line's cross-section along the minor axis.
        let half = reach * length / along[major].abs();
        let (low, high) = (
            a[major].min(b[major]) - reach,
            a[major].max(b[major]) + reach,
        );
        for step in pixels(low, high) {
            let middle =
                from[minor] + (f64::from(step) + 0.5 - from[major]) * along[minor] / along[major];
            for side in pixels(middle - half, middle + half) {
                let (x, y) = if major == 0 {
                    (step, side)
                } else {
                    (side, step)
                };
                let away = [f64::from(x) + 0.5 - from[0], f64::from(y) + 0.5 - from[1]];
                let t = (away[0] * along[0] + away[1] * along[1]) / (length * length);
                let nearest = at(t.clamp(0.0, 1.0));
                let distance =
                    (f64::from(x) + 0.5 - nearest[0]).hypot(f64::from(y) + 0.5 - nearest[1]);
                let cover = (0.5 * width + 0.5 - distance).clamp(0.0, 1.0);
                if let Some((colour, share)) = colour(t.clamp(0.0, 1.0)).filter(|_| cover > 0.0) {
                    self.blend(x, y, colour, cover * share);
                }
            }
        }
    }

    /// A ring around a point: everything from `inner` to `outer` pixels from it; a disc if `inner` is 0.
    pub(super) fn ring(&mut self, [x, y]: [f64; 2], inner: f64, outer: f64, colour: Colour) {
        for py in pixels(y - outer - 1.0, y + outer + 1.0) {
            for px in pixels(x - outer - 1.0, x + outer + 1.0) {
                let away = (f64::from(px) + 0.5 - x).hypot(f64::from(py) + 0.5 - y);
                let mut cover = (outer + 0.5 - away).clamp(0.0, 1.0);
                if inner > 0.0 {
                    cover = cover.min((away - inner + 0.5).clamp(0.0, 1.0));
                }
                self.blend(px, py, colour, cover);
            }
        }
    }

    /// Text with its top left corner at (x, y), dots of `scale` pixels; a dark edge keeps it legible on any background.
    pub(super) fn text(&mut self, text: &str, [x, y]: [u32; 2], scale: u32, colour: Colour) {
        for (shadow, colour) in [(true, [0; 3]), (false, colour)] {
            for (i, character) in text.chars().enumerate() {
                let left = x + i as u32 * GLYPH * scale;
                for (column, row) in dots(character) {
                    let dot = [left + column * scale, y + row * scale];
                    self.dot(dot, scale, colour, shadow);
                }
            }
        }
    }

    fn dot(&mut self, [x, y]: [u32; 2], scale: u32, colour: Colour, shadow: bool) {
        let edge = u32::from(shadow);
        for py in y.saturating_sub(edge)..y + scale + edge {
            for px in x.saturating_sub(edge)..x + scale + edge {
                self.blend(px, py, colour, 1.0);
            }
        }
    }
}

/// A mixture of two colours.
pub(super) fn mixed(under: Colour, over: Colour, share: f64) -> Colour {
    std::array::from_fn(|i| {
        let (under, over) = (f64::from(under[i]), f64::from(over[i]));
        (under + share * (over - under)).round() as u8
    })
}

/// Width of a text, pixels.
pub(super) fn text_width(text: &str, scale: u32) -> u32 {
    text.chars().count() as u32 * GLYPH * scale
}

/// A text in lines of at most `most` characters, broken at spaces if possible.
pub(super) fn wrapped(text: &str, most: usize) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in text.split_whitespace() {
        let mut rest: Vec<char> = word.chars().collect();
        loop {
            let line = lines.last_mut().expect("there is one from the beginning");
            let used = line.chars().count();
            let gap = usize::from(used > 0);
            if used + gap + rest.len() <= most {
                line.push_str(&" ".repeat(gap));
                line.extend(&rest);
                break;
            }
            if used == 0 {
                line.extend(rest.drain(..most));
            }
            lines.push(String::new());
        }
    }
    lines
}

/// Columns and rows of the dots of a character; a question mark if the font lacks it.
fn dots(character: char) -> impl Iterator<Item = (u32, u32)> {
    // The font's superscript figures are illegible at this size.
    let character = match character {
        '²' => '2',
        '³' => '3',
        other => other,
    };
    let glyph = [character, '?']
        .into_iter()
        .find_map(|c| {
            let basic = font8x8::BASIC_FONTS.get(c);
            basic
                .or_else(|| font8x8::LATIN_FONTS.get(c))
                .or_else(|| font8x8::GREEK_FONTS.get(c))
        })
        .unwrap_or_default();
    (0..GLYPH).flat_map(move |row| {
        let bits = glyph[row as usize];
        (0..GLYPH)
            .filter(move |column| bits >> column & 1 == 1)
            .map(move |column| (column, row))
    })
}

/// Indices of the pixels that overlap low..high, none of them negative.
fn pixels(low: f64, high: f64) -> std::ops::Range<u32> {
    let low = low.floor().max(0.0);
    let high = high.ceil().max(0.0);
    low as u32..high as u32
}

/// Relative positions at which a line enters and leaves a rectangle grown by `reach` (Liang and Barsky 1984).
fn clipped(from: [f64; 2], to: [f64; 2], rect: Rect, reach: f64) -> Option<[f64; 2]> {
    if !from.iter().chain(&to).all(|value| value.is_finite()) {
        return None;
    }
    let (mut first, mut last) = (0.0_f64, 1.0_f64);
    for (axis, [low, high]) in rect.ends().into_iter().enumerate() {
        let (low, high) = (f64::from(low) - reach, f64::from(high) + reach);
        let step = to[axis] - from[axis];
        if step == 0.0 {
            if !(low..=high).contains(&from[axis]) {
                return None;
            }
            continue;
        }
        let (a, b) = ((low - from[axis]) / step, (high - from[axis]) / step);
        first = first.max(a.min(b));
        last = last.min(a.max(b));
    }
    (first <= last).then_some([first, last])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_passes_through_its_points_and_stays_inside_the_clip() {
        let mut canvas = Canvas::new(60, 40, [0; 3]);
        let rect = Rect {
            x: 10,
            y: 5,
            width: 40,
            height: 30,
        };
        canvas.within(rect, |canvas| {
            canvas.line([-1e9, 20.5], [1e9, 20.5], 1.0, [255; 3]);
            canvas.line([30.5, 0.0], [30.5, 40.0], 1.0, [255; 3]);
            canvas.line([f64::NAN, 0.0], [30.5, 40.0], 1.0, [255; 3]);
        });
        let image = canvas.into_image();
        for (x, y, pixel) in image.enumerate_pixels() {
            let inside = (10..50).contains(&x) && (5..35).contains(&y);
            let expected = inside && (y == 20 || x == 30);
            assert_eq!(pixel.0 == [255; 3], expected, "{x} {y}");
        }
    }

    #[test]
    fn lines_of_text_break_at_spaces_and_never_exceed_their_width() {
        assert_eq!(wrapped("one two three", 7), ["one two", "three"]);
        assert_eq!(wrapped("abcdefghij kl", 4), ["abcd", "efgh", "ij", "kl"]);
        assert_eq!(wrapped("", 4), [""]);
    }

    #[test]
    fn characters_that_the_font_lacks_are_question_marks() {
        assert!(dots('漢').eq(dots('?')));
        assert!(!dots('é').eq(dots('?')));
    }
}
