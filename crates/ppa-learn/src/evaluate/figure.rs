//! Figures with two axes, as SVG and as PNG.

mod png;
mod svg;

/// How a series is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mark {
    /// A dot at each point.
    Dots,
    /// Straight lines from point to point.
    Line,
}

/// Points that belong together.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// What it is.
    pub name: String,
    /// How it is drawn.
    pub mark: Mark,
    /// Points; those outside the axes are left out.
    pub points: Vec<[f64; 2]>,
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
    /// What is drawn, the last one on top.
    pub series: Vec<Series>,
}

/// Columns and rows of a figure.
const SIZE: [i32; 2] = [640, 480];
/// Left, top, right and bottom margin around the axes.
const MARGINS: [i32; 4] = [80, 40, 20, 60];
/// Blue, orange, green and grey of the Okabe-Ito palette, which colour-blind people tell apart.
const COLOURS: [[u8; 3]; 4] = [[0, 114, 178], [213, 94, 0], [0, 158, 115], [110, 110, 110]];

/// Something on the page; colours are places in [`COLOURS`], text stands around its place.
enum Shape<'a> {
    Line([f64; 2], [f64; 2], Option<usize>),
    Dot([f64; 2], usize),
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
        draw(Shape::Text([width / 2.0, 14.0], &self.title, None));
        draw(Shape::Text(
            [width / 2.0, height - 18.0],
            &self.labels[0],
            None,
        ));
        // Beside the top of its axis, so that it need not stand upright.
        draw(Shape::Text([90.0, 30.0], &self.labels[1], None));
        for (i, series) in self.series.iter().enumerate() {
            let colour = i % COLOURS.len();
            let inside = |point: &[f64; 2]| {
                (0..2).all(|a| (self.ranges[a][0]..=self.ranges[a][1]).contains(&point[a]))
            };
            let points: Vec<[f64; 2]> = series.points.iter().copied().filter(inside).collect();
            let places: Vec<[f64; 2]> = points.iter().map(|&point| self.place(point)).collect();
            match series.mark {
                Mark::Dots => places.iter().for_each(|&at| draw(Shape::Dot(at, colour))),
                Mark::Line => {
                    for pair in places.windows(2) {
                        draw(Shape::Line(pair[0], pair[1], Some(colour)));
                    }
                }
            }
            let at = [width - 120.0, 54.0 + 16.0 * i as f64];
            draw(Shape::Text(at, &series.name, Some(colour)));
        }
    }
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

    /// A single dot in the middle of the axes is drawn there, in its colour, in both formats.
    #[test]
    fn points_stand_where_the_axes_say() {
        let figure = Figure {
            title: "a < b".into(),
            labels: ["x".into(), "y".into()],
            ranges: [[0.0, 2.0], [1.0, 3.0]],
            series: vec![Series {
                name: "one".into(),
                mark: Mark::Dots,
                points: vec![[1.0, 2.0], [5.0, 2.0]],
            }],
        };
        let svg = figure.to_svg();
        assert_eq!(svg.matches("<circle cx=\"350\" cy=\"230\"").count(), 1);
        assert_eq!(
            svg.matches("<circle").count(),
            1,
            "the other one lies outside"
        );
        assert!(svg.contains("a &lt; b") && svg.ends_with("</svg>\n"));
        let png = image::load_from_memory(&figure.to_png()).unwrap().to_rgb8();
        assert_eq!(png.dimensions(), (640, 480));
        assert_eq!(png.get_pixel(350, 230).0, COLOURS[0]);
        assert_eq!(png.get_pixel(340, 230).0, [255; 3]);
    }
}
