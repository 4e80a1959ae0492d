//! Shapes as SVG.

use std::fmt::Write;

use super::{COLOURS, SIZE, Shape, tint};

pub struct Page(String);

impl Page {
    pub fn new() -> Self {
        let [width, height] = SIZE;
        Self(format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" \
             font-family=\"sans-serif\" font-size=\"13\">\n\
             <rect width=\"{width}\" height=\"{height}\" fill=\"white\"/>\n"
        ))
    }

    pub fn draw(&mut self, shape: Shape) {
        let places = |point: [f64; 2]| point.map(|x| (x * 100.0).round() / 100.0);
        let line = match shape {
            Shape::Line(from, to, of) => {
                let ([x1, y1], [x2, y2]) = (places(from), places(to));
                let colour = colour(of);
                let width = if of.is_some() { 2 } else { 1 };
                format!(
                    "<line x1=\"{x1}\" y1=\"{y1}\" x2=\"{x2}\" y2=\"{y2}\" stroke=\"{colour}\" stroke-width=\"{width}\"/>"
                )
            }
            Shape::Tile(from, to, share) => {
                let ([x1, y1], [x2, y2]) = (places(from), places(to));
                let (x, y) = (x1.min(x2), y1.min(y2));
                let (width, height) = ((x1 - x2).abs(), (y1 - y2).abs());
                let fill = hexadecimal(tint(share));
                format!(
                    "<rect x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\" fill=\"{fill}\"/>"
                )
            }
            Shape::Dot(at, of) => {
                let ([x, y], colour) = (places(at), colour(Some(of)));
                format!("<circle cx=\"{x}\" cy=\"{y}\" r=\"2.5\" fill=\"{colour}\"/>")
            }
            Shape::Text(at, text, of) => {
                let ([x, y], colour) = (places(at), colour(of));
                let text = text.replace('&', "&amp;").replace('<', "&lt;");
                format!(
                    "<text x=\"{x}\" y=\"{y}\" fill=\"{colour}\" text-anchor=\"middle\" dominant-baseline=\"middle\">{text}</text>"
                )
            }
        };
        writeln!(self.0, "{line}").expect("a string takes all");
    }

    pub fn finish(self) -> String {
        self.0 + "</svg>\n"
    }
}

fn colour(of: Option<usize>) -> String {
    hexadecimal(of.map_or([0; 3], |i| COLOURS[i]))
}

fn hexadecimal([r, g, b]: [u8; 3]) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}
