//! Figures with two axes, as SVG and as PNG.

mod clip;
mod png;
mod svg;

/// How a series is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mark {
    /// A dot at each point.
    Dots,
    /// Straight lines from point to point.
    Line,
    /// Both.
    DotsAndLine,
}

/// Points that belong together.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// What it is.
    pub name: String,
    /// How it is drawn.
    pub mark: Mark,
    /// Points. Dots beyond the axes stand at the rim and lines are cut there, which a note below the figure counts; values
    /// that are not finite are counted as well, drawn nowhere, and interrupt a line.
    pub points: Vec<[f64; 2]>,
}

/// A tinted rectangle with a text in it.
#[derive(Debug, Clone, PartialEq)]
pub struct Tile {
    /// Both ends along the axes, x first, within the figure's ranges.
    pub ranges: [[f64; 2]; 2],
    /// From 0, white, to 1, blue.
    pub share: f64,
    /// What stands in it.
    pub text: String,
}

/// A figure with two linear axes.
#[derive(Debug, Clone, PartialEq)]
pub struct Figure {
    /// Above it.
    pub title: String,
    /// Names of the axes, x first.
    pub labels: [String; 2],
    /// Both ends of the axes, x first.
    pub ranges: [[f64; 2]; 2],
    /// What is drawn below the series.
    pub tiles: Vec<Tile>,
    /// What is drawn, the last one on top.
    pub series: Vec<Series>,
}

/// Columns and rows of a figure.
const SIZE: [i32; 2] = [640, 480];
/// Left, top, right and bottom margin around the axes.
const MARGINS: [i32; 4] = [80, 40, 20, 60];
/// Row of the second axis' name and of those of the series.
const LABELS_Y: f64 = 27.0;
/// Blue, orange, green and grey of the Okabe-Ito palette, which colour-blind people distinguish.
const COLOURS: [[u8; 3]; 4] = [[0, 114, 178], [213, 94, 0], [0, 158, 115], [110, 110, 110]];

/// Something on the page; colours are places in [`COLOURS`], text stands around its place.
enum Shape<'a> {
    Line([f64; 2], [f64; 2], Option<usize>),
    Dot([f64; 2], usize),
    /// Two opposite corners, and a share of the first colour on white.
    Tile([f64; 2], [f64; 2], f64),
    Text([f64; 2], &'a str, Option<usize>),
}

impl Figure {
    /// The figure as SVG.
    pub fn to_svg(&self) -> String {
        let mut page = svg::Page::new();
        self.draw(&mut |shape| page.draw(shape));
        page.finish()
    }

    /// The figure as PNG.
    pub fn to_png(&self) -> Vec<u8> {
        let mut page = png::Page::new();
        self.draw(&mut |shape| page.draw(shape));
        page.finish()
    }

    fn place(&self, point: [f64; 2]) -> [f64; 2] {
        let share = [0, 1].map(|axis| {
            let [from, to] = self.ranges[axis];
            (point[axis] - from) / (to - from)
        });
        let [left, top, right, bottom] = MARGINS.map(f64::from);
        let [width, height] = SIZE.map(f64::from);
        [
            left + share[0] * (width - left - right),
            height - bottom - share[1] * (height - top - bottom),
        ]
    }

    fn draw(&self, draw: &mut impl FnMut(Shape)) {
        for tile in &self.tiles {
            let [x, y] = tile.ranges;
            let [from, to] = [0, 1].map(|end| self.place([x[end], y[end]]));
            draw(Shape::Tile(from, to, tile.share));
            let middle = [0, 1].map(|axis| 0.5 * (from[axis] + to[axis]));
            draw(Shape::Text(middle, &tile.text, None));
        }
        self.draw_axes(draw);
        let [width, height] = SIZE.map(f64::from);
        let mut beyond = 0;
        for (i, series) in self.series.iter().enumerate() {
            beyond += self.draw_series(series, i % COLOURS.len(), draw);
        }
        // Names stand above the axes, the last one at their right end.
        let mut right = width - f64::from(MARGINS[2]);
        for (i, series) in self.series.iter().enumerate().rev() {
            let at = [right - half_width(&series.name), LABELS_Y];
            draw(Shape::Text(at, &series.name, Some(i % COLOURS.len())));
            right -= 2.0 * half_width(&series.name) + 16.0;
        }
        if beyond > 0 {
            let note = format!(
                "{beyond} {} beyond the axes: dots stand at the rim, lines are cut there",
                if beyond == 1 {
                    "value is"
                } else {
                    "values are"
                }
            );
            draw(Shape::Text([width / 2.0, height - 6.0], &note, None));
        }
    }

    /// Draws a series and counts its points that lie beyond the axes or nowhere.
    fn draw_series(&self, series: &Series, colour: usize, draw: &mut impl FnMut(Shape)) -> usize {
        if series.mark != Mark::Dots {
            for pair in series.points.windows(2) {
                if let Some([from, to]) = clip::segment([pair[0], pair[1]], self.ranges) {
                    let [from, to] = [from, to].map(|point| self.place(point));
                    draw(Shape::Line(from, to, Some(colour)));
                }
            }
        }
        let finite = |point: &&[f64; 2]| point.iter().all(|x| x.is_finite());
        if series.mark != Mark::Line {
            for &point in series.points.iter().filter(finite) {
                let place = self.place(clip::point(point, self.ranges));
                draw(Shape::Dot(place, colour));
            }
        }
        let beyond = |point: &&[f64; 2]| clip::point(**point, self.ranges) != **point;
        series.points.iter().filter(beyond).count()
    }

    fn draw_axes(&self, draw: &mut impl FnMut(Shape)) {
        let [x, y] = self.ranges;
        let corners = [[x[0], y[0]], [x[1], y[0]], [x[1], y[1]], [x[0], y[1]]];
        let corners = corners.map(|corner| self.place(corner));
        for i in 0..4 {
            draw(Shape::Line(corners[i], corners[(i + 1) % 4], None));
        }
        for (axis, offset) in [(0, [0.0, 16.0]), (1, [-36.0, 0.0])] {
            for tick in ticks(self.ranges[axis]) {
                let mut point = [x[0], y[0]];
                point[axis] = tick;
                let [px, py] = self.place(point);
                let text = format!("{}", (tick * 1e6).round() / 1e6);
                draw(Shape::Text([px + offset[0], py + offset[1]], &text, None));
                let inwards = [[px, py - 5.0], [px + 5.0, py]][axis];
                draw(Shape::Line([px, py], inwards, None));
            }
        }
        let [width, height] = SIZE.map(f64::from);
        let below = [width / 2.0, height - 24.0];
        draw(Shape::Text([width / 2.0, 10.0], &self.title, None));
        draw(Shape::Text(below, &self.labels[0], None));
        // Above its axis, so that it need not stand upright.
        let left = half_width(&self.labels[1]).max(86.0) + 4.0;
        draw(Shape::Text([left, LABELS_Y], &self.labels[1], None));
    }
}

/// Half the width of a text in the PNG's letters of 8 pixels, which are the wider ones.
fn half_width(text: &str) -> f64 {
    4.0 * text.chars().count() as f64
}

/// Share of the first colour on white.
fn tint(share: f64) -> [u8; 3] {
    COLOURS[0].map(|part| (255.0 - share * (255.0 - f64::from(part))).round() as u8)
}

/// Round numbers within a range, 4 to 10 of them, at steps of 1, 2 or 5 times a power of ten.
fn ticks([from, to]: [f64; 2]) -> Vec<f64> {
    let least = (to - from) / 10.0;
    let power = 10_f64.powf(least.log10().floor());
    let steps = [1.0, 2.0, 5.0, 10.0].map(|step| step * power);
    let step = steps.into_iter().find(|&step| step >= least * 0.999);
    let step = step.unwrap_or(10.0 * power);
    let first = (from / step - 1e-9).ceil() as i64;
    let last = (to / step + 1e-9).floor() as i64;
    (first..=last).map(|i| i as f64 * step).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_few() {
        let close = |found: Vec<f64>, expected: &[f64]| {
            assert_eq!(found.len(), expected.len(), "{found:?}");
            for (found, expected) in found.iter().zip(expected) {
                assert!((found - expected).abs() < 1e-9, "{found}, {expected}");
            }
        };
        close(
            ticks([1.0, 3.0]),
            &[1.0, 1.2, 1.4, 1.6, 1.8, 2.0, 2.2, 2.4, 2.6, 2.8, 3.0],
        );
        close(
            ticks([0.0, 90.0]),
            &[0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0, 90.0],
        );
        close(
            ticks([0.0, 0.047]),
            &[
                0.0, 0.005, 0.01, 0.015, 0.02, 0.025, 0.03, 0.035, 0.04, 0.045,
            ],
        );
    }

    /// A dot in the middle of the axes is drawn there, in its colour, in both formats; one beyond them at the rim.
    #[test]
    fn points_stand_where_the_axes_say() {
        let mut figure = Figure {
            title: "a < b".into(),
            labels: ["x".into(), "y".into()],
            ranges: [[0.0, 2.0], [1.0, 3.0]],
            tiles: vec![Tile {
                ranges: [[0.0, 0.5], [1.0, 1.5]],
                share: 0.5,
                text: "7".into(),
            }],
            series: vec![Series {
                name: "one".into(),
                mark: Mark::Dots,
                points: vec![[1.0, 2.0], [5.0, 2.0], [1.0, f64::NAN]],
            }],
        };
        let svg = figure.to_svg();
        assert_eq!(svg.matches("<circle cx=\"350\" cy=\"230\"").count(), 1);
        assert_eq!(svg.matches("<circle cx=\"620\" cy=\"230\"").count(), 1);
        assert_eq!(svg.matches("<circle").count(), 2, "{svg}");
        assert!(svg.contains("2 values are beyond the axes"), "{svg}");
        assert!(svg.contains("a &lt; b") && svg.ends_with("</svg>\n"));
        let png = image::load_from_memory(&figure.to_png()).unwrap().to_rgb8();
        assert_eq!(png.dimensions(), (640, 480));
        assert_eq!(png.get_pixel(350, 230).0, COLOURS[0]);
        assert_eq!(png.get_pixel(340, 230).0, [255; 3]);
        // The middle between white and the first colour.
        assert_eq!(png.get_pixel(100, 400).0, [128, 185, 217]);
        figure.series[0].points.truncate(1);
        assert!(!figure.to_svg().contains("beyond"));
    }

    /// A line to a point beyond the axes leaves them where it crosses the rim.
    #[test]
    fn lines_are_cut_at_the_rim() {
        let figure = Figure {
            title: String::new(),
            labels: [String::new(), String::new()],
            ranges: [[0.0, 2.0], [0.0, 2.0]],
            tiles: Vec::new(),
            series: vec![Series {
                name: String::new(),
                mark: Mark::Line,
                points: vec![[0.0, 0.0], [1.0, 4.0], [2.0, 4.0], [2.0, 1.0]],
            }],
        };
        let svg = figure.to_svg();
        let rim = "x1=\"80\" y1=\"420\" x2=\"215\" y2=\"40\"";
        assert!(svg.contains(rim), "{svg}");
        assert_eq!(svg.matches("stroke-width=\"2\"").count(), 2, "{svg}");
    }
}
