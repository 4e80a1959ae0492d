//! Charts with two linear axes, drawn by `plotters` as SVG and as PNG.

mod clip;
pub(crate) mod pixels;

use std::io::Cursor;
use std::path::Path;

use image::ImageFormat;
use plotters::chart::ChartContext;
use plotters::coord::Shift;
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use ppa_dataset::{FileError, write_whole};

use pixels::{FONT, SCALE, picture};

/// How a series is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mark {
    /// A dot at each point.
    Dots,
    /// Straight lines from point to point.
    Line,
    /// Both.
    DotsAndLine,
    /// The area between the lines and the first axis.
    Area,
}

/// Points drawn together.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// Its name in the legend.
    pub name: String,
    /// How it is drawn.
    pub mark: Mark,
    /// Points. Dots beyond the axes are drawn at the rim and lines are cut there; a note below the chart gives their number. Values
    /// that are not finite are counted as well, not drawn, and interrupt a line.
    pub points: Vec<[f64; 2]>,
    /// Half the height of a band around each point; empty for none.
    pub spread: Vec<f64>,
    /// Points to ring.
    pub ringed: Vec<[f64; 2]>,
}

impl Series {
    /// A series without a band and rings.
    pub fn new(name: &str, mark: Mark, points: Vec<[f64; 2]>) -> Self {
        Self {
            name: name.to_owned(),
            mark,
            points,
            spread: Vec::new(),
            ringed: Vec::new(),
        }
    }
}

/// A tinted rectangle with a text in it.
#[derive(Debug, Clone, PartialEq)]
pub struct Tile {
    /// Ends along both axes, x first, within the chart's ranges.
    pub ranges: [[f64; 2]; 2],
    /// From 0, white, to 1, blue.
    pub share: f64,
    /// Its text.
    pub text: String,
}

/// A chart with two linear axes.
#[derive(Debug, Clone, PartialEq)]
pub struct Chart {
    /// Columns and rows.
    pub size: [u32; 2],
    /// Title above the chart; empty for none.
    pub title: String,
    /// Names of the axes, x first.
    pub labels: [String; 2],
    /// Ends of both axes, x first.
    pub ranges: [[f64; 2]; 2],
    /// Tiles, drawn below the series.
    pub tiles: Vec<Tile>,
    /// Series, the last one on top.
    pub series: Vec<Series>,
}

/// Colours that people with any colour vision distinguish (Okabe and Ito 2008).
const COLOURS: [RGBColor; 6] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
];
/// Height of a line of text.
const LINE: i32 = 18;
/// Width of a letter in the font of the PNG, the wider one.
const LETTER: i32 = 8;
const RIGHT: i32 = 16;

type Axes<'a, DB> = ChartContext<'a, DB, Cartesian2d<RangedCoordf64, RangedCoordf64>>;
type Drawn<DB> = Result<(), DrawingAreaErrorKind<<DB as DrawingBackend>::ErrorType>>;

fn colour(series: usize) -> RGBColor {
    COLOURS[series % COLOURS.len()]
}

fn font(colour: &RGBColor) -> TextStyle<'_> {
    TextStyle::from(("sans-serif", FONT).into_font()).color(colour)
}

fn centred(colour: &RGBColor) -> TextStyle<'_> {
    font(colour).pos(Pos::new(HPos::Center, VPos::Center))
}

impl Chart {
    /// The chart as SVG, without embedded fonts.
    pub fn to_svg(&self) -> String {
        let [width, height] = self.size;
        let canvas = self.size.map(|side| side * SCALE as u32);
        let mut svg = String::new();
        self.draw(&SVGBackend::with_string(&mut svg, canvas.into()).into_drawing_area())
            .expect("a string takes every shape");
        let of_canvas = format!("width=\"{}\" height=\"{}\"", canvas[0], canvas[1]);
        svg.replacen(
            &of_canvas,
            &format!("width=\"{width}\" height=\"{height}\""),
            1,
        )
    }

    /// The chart as part of an HTML page, where SVG needs no namespace, so the page contains no addresses.
    pub(crate) fn to_inline_svg(&self) -> String {
        self.to_svg()
            .replacen(" xmlns=\"http://www.w3.org/2000/svg\"", "", 1)
    }

    /// The chart as PNG.
    pub fn to_png(&self) -> Vec<u8> {
        let mut bytes = Cursor::new(Vec::new());
        let picture = picture(self.size, |page| self.draw(page));
        let written = picture.write_to(&mut bytes, ImageFormat::Png);
        written.expect("memory takes every image");
        bytes.into_inner()
    }

    /// Writes `NAME.svg` and `NAME.png` into a folder.
    ///
    /// # Errors
    /// [`FileError`] naming the file that cannot be written.
    pub fn write(&self, folder: &Path, name: &str) -> Result<(), FileError> {
        write_whole(
            &folder.join(format!("{name}.svg")),
            self.to_svg().as_bytes(),
        )?;
        write_whole(&folder.join(format!("{name}.png")), &self.to_png())
    }

    fn draw<DB: DrawingBackend>(&self, page: &DrawingArea<DB, Shift>) -> Drawn<DB> {
        page.fill(&WHITE)?;
        let mut top = LINE / 2;
        if !self.title.is_empty() {
            page.draw_text(
                &self.title,
                &centred(&BLACK),
                self.at(self.size[0] as i32 / 2, LINE),
            )?;
            top += LINE;
        }
        top += self.draw_legend(page, top)?;
        let [x, y] = self.ranges;
        let mut axes = ChartBuilder::on(page)
            .margin_top(top * SCALE)
            .margin_right(RIGHT * SCALE)
            .margin_bottom(LINE * SCALE)
            .margin_left(4 * SCALE)
            .x_label_area_size(2 * LINE * SCALE)
            .y_label_area_size(56 * SCALE)
            .build_cartesian_2d(x[0]..x[1], y[0]..y[1])?;
        for tile in &self.tiles {
            draw_tile(&mut axes, tile)?;
        }
        let number = |value: &f64| format!("{}", (value * 1e6).round() / 1e6);
        axes.configure_mesh()
            .bold_line_style(
                BLACK
                    .mix(if self.tiles.is_empty() { 0.12 } else { 0.0 })
                    .stroke_width(SCALE as u32),
            )
            .light_line_style(TRANSPARENT)
            .axis_style(BLACK.stroke_width(SCALE as u32))
            .set_all_tick_mark_size(4 * SCALE)
            .x_labels(10)
            .y_labels(10)
            .x_label_formatter(&number)
            .y_label_formatter(&number)
            .label_style(font(&BLACK))
            .axis_desc_style(font(&BLACK))
            .x_desc(&self.labels[0])
            .y_desc(&self.labels[1])
            .draw()?;
        let mut beyond = 0;
        for (i, series) in self.series.iter().enumerate() {
            self.draw_series(&mut axes, series, colour(i))?;
            let cut = |point: &&[f64; 2]| clip::point(**point, self.ranges) != **point;
            beyond += series.points.iter().filter(cut).count();
        }
        if beyond > 0 {
            let values = if beyond == 1 {
                "value is"
            } else {
                "values are"
            };
            let note = format!(
                "{beyond} {values} beyond the axes: points are drawn at the edge, lines are clipped"
            );
            let [width, height] = self.size.map(|side| side as i32);
            page.draw_text(
                &note,
                &centred(&BLACK),
                self.at(width / 2, height - LINE / 2),
            )?;
        }
        page.present()
    }

    fn at(&self, x: i32, y: i32) -> (i32, i32) {
        (x * SCALE, y * SCALE)
    }

    /// Writes the names of the series in their colours, as many per line as fit, and returns the height of the lines.
    fn draw_legend<DB: DrawingBackend>(
        &self,
        page: &DrawingArea<DB, Shift>,
        top: i32,
    ) -> Result<i32, DrawingAreaErrorKind<DB::ErrorType>> {
        const LEFT: i32 = 60;
        let (mut x, mut line) = (LEFT, 0);
        for (i, series) in self.series.iter().enumerate() {
            let width = LETTER * series.name.chars().count() as i32;
            if x > LEFT && x + width > self.size[0] as i32 - RIGHT {
                (x, line) = (LEFT, line + 1);
            }
            let style = font(&COLOURS[i % COLOURS.len()]).pos(Pos::new(HPos::Left, VPos::Center));
            page.draw_text(
                &series.name,
                &style,
                self.at(x, top + line * LINE + LINE / 2),
            )?;
            x += width + 2 * LETTER;
        }
        Ok(if self.series.is_empty() {
            0
        } else {
            (line + 1) * LINE
        })
    }

    fn draw_series<DB: DrawingBackend>(
        &self,
        axes: &mut Axes<DB>,
        series: &Series,
        colour: RGBColor,
    ) -> Drawn<DB> {
        let inside = |point: [f64; 2]| clip::point(point, self.ranges).into();
        let finite = |point: &&[f64; 2]| point.iter().all(|x| x.is_finite());
        if series.spread.iter().any(|half| *half > 0.0) {
            let edge = |sign: f64| {
                let points = series.points.iter().zip(&series.spread);
                points.map(move |([x, y], half)| inside([*x, y + sign * half]))
            };
            let band: Vec<(f64, f64)> = edge(1.0).chain(edge(-1.0).rev()).collect();
            axes.draw_series([Polygon::new(band, colour.mix(0.2).filled())])?;
        }
        if series.mark == Mark::Area
            && let (Some(first), Some(last)) = (series.points.first(), series.points.last())
        {
            let floor = self.ranges[1][0];
            let ends = [[first[0], floor], [last[0], floor]].map(inside);
            let line = series.points.iter().map(|point| inside(*point));
            let outline: Vec<(f64, f64)> =
                [ends[0]].into_iter().chain(line).chain([ends[1]]).collect();
            axes.draw_series([Polygon::new(outline, colour.mix(0.6).filled())])?;
        }
        if matches!(series.mark, Mark::Line | Mark::DotsAndLine) {
            let style = colour.stroke_width(2 * SCALE as u32);
            for line in clip::lines(&series.points, self.ranges) {
                let line: Vec<(f64, f64)> = line.into_iter().map(Into::into).collect();
                axes.draw_series([PathElement::new(line, style)])?;
            }
        }
        if matches!(series.mark, Mark::Dots | Mark::DotsAndLine) {
            let dots = series.points.iter().filter(finite);
            axes.draw_series(
                dots.map(|point| Circle::new(inside(*point), 5 * SCALE / 2, colour.filled())),
            )?;
        }
        let ring = RED.stroke_width(2 * SCALE as u32);
        let rings = series.ringed.iter().filter(finite);
        axes.draw_series(rings.map(|point| Circle::new(inside(*point), 5 * SCALE, ring)))?;
        Ok(())
    }
}

fn draw_tile<DB: DrawingBackend>(axes: &mut Axes<DB>, tile: &Tile) -> Drawn<DB> {
    let [[left, right], [low, high]] = tile.ranges;
    let colour = COLOURS[0].mix(tile.share);
    axes.draw_series([Rectangle::new(
        [(left, low), (right, high)],
        colour.filled(),
    )])?;
    let middle = (0.5 * (left + right), 0.5 * (low + high));
    axes.draw_series([Text::new(tile.text.clone(), middle, centred(&BLACK))])?;
    Ok(())
}

/// Smallest and largest value, always different: the range of an axis.
pub fn range(values: impl Iterator<Item = f64>) -> [f64; 2] {
    let [low, high] = values.fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], v| {
        [l.min(v), h.max(v)]
    });
    match high - low {
        span if span > 0.0 => [low, high],
        _ if low.is_finite() => [low - 0.5, high + 0.5],
        _ => [0.0, 1.0],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart(series: Vec<Series>) -> Chart {
        Chart {
            size: [640, 480],
            title: "a < b".into(),
            labels: ["x".into(), "y".into()],
            ranges: [[0.0, 2.0], [1.0, 3.0]],
            tiles: Vec::new(),
            series,
        }
    }

    /// Positions of the shapes of a name, by two of their attributes.
    fn places(svg: &str, shape: &str, attributes: [&str; 2]) -> Vec<[i32; 2]> {
        let lines = svg
            .lines()
            .filter(|line| line.starts_with(&format!("<{shape} ")));
        let value = |line: &str, name: &str| {
            let rest = line.split(&format!(" {name}=\"")).nth(1).unwrap();
            rest.split('"').next().unwrap().parse().unwrap()
        };
        lines
            .map(|line| attributes.map(|name| value(line, name)))
            .collect()
    }

    /// In both formats, a dot in the middle of the axes is drawn there in its colour, and one beyond them at the rim.
    #[test]
    fn points_stand_where_the_axes_say() {
        let points = vec![[1.0, 2.0], [5.0, 2.0], [1.0, f64::NAN], [0.0, 1.0]];
        let mut chart = chart(vec![Series::new("one", Mark::Dots, points)]);
        let svg = chart.to_svg();
        let [middle, rim, origin] = places(&svg, "circle", ["cx", "cy"])[..] else {
            panic!("three dots: {svg}")
        };
        // Positions are rounded to whole pixels of the canvas.
        assert!((rim[0] + origin[0] - 2 * middle[0]).abs() <= 1, "{svg}");
        assert_eq!(rim[1], middle[1]);
        assert_eq!(rim[0], (640 - RIGHT) * SCALE - 1);
        assert!(svg.contains("2 values are beyond the axes"), "{svg}");
        assert!(svg.contains("a &lt; b") && svg.ends_with("</svg>\n"));
        assert!(svg.contains("http") && !chart.to_inline_svg().contains("http"));
        assert!(
            svg.starts_with("<svg width=\"640\" height=\"480\" viewBox=\"0 0 2560 1920\""),
            "{svg}"
        );
        let png = image::load_from_memory(&chart.to_png()).unwrap().to_rgb8();
        assert_eq!(png.dimensions(), (640, 480));
        let pixel = |[x, y]: [i32; 2]| png.get_pixel((x / SCALE) as u32, (y / SCALE) as u32).0;
        assert_eq!(pixel(middle), [0, 114, 178]);
        assert_eq!(
            pixel([middle[0] - 10 * SCALE, middle[1] - 10 * SCALE]),
            [255; 3]
        );
        chart.series[0].points.truncate(1);
        assert!(!chart.to_svg().contains("beyond"));
    }

    /// The names of many series take several lines, none of which extends past the right end.
    #[test]
    fn long_legends_are_broken() {
        let name = "a name of thirty-two characters.";
        let series = (0..5).map(|_| Series::new(name, Mark::Line, Vec::new()));
        let svg = chart(series.collect()).to_svg();
        let texts = svg.split("<text ").filter(|text| text.contains(name));
        let starts: Vec<i32> = texts
            .map(|text| {
                text.strip_prefix("x=\"")
                    .unwrap()
                    .split('"')
                    .next()
                    .unwrap()
                    .parse()
                    .unwrap()
            })
            .collect();
        assert_eq!(starts.len(), 5);
        let end = |start: &i32| start + SCALE * LETTER * name.len() as i32;
        assert!(
            starts.iter().all(|start| end(start) < 640 * SCALE),
            "{starts:?}"
        );
        assert_eq!(starts[0], starts[2]);
    }

    /// A tile with half the share is half as blue, in both formats, and contains its text.
    #[test]
    fn tiles_are_tinted_by_their_share() {
        let tile = Tile {
            ranges: [[0.0, 1.0], [1.0, 2.0]],
            share: 0.5,
            text: "7".into(),
        };
        let chart = Chart {
            tiles: vec![tile],
            ..chart(Vec::new())
        };
        let svg = chart.to_svg();
        assert!(
            svg.contains("opacity=\"0.5\"") && svg.contains("\n7\n"),
            "{svg}"
        );
        let png = image::load_from_memory(&chart.to_png()).unwrap().to_rgb8();
        assert_eq!(png.get_pixel(100, 390).0, [128, 185, 217]);
    }

    #[test]
    fn ranges_are_never_empty() {
        assert_eq!(range([3.0, 1.0, 2.0].into_iter()), [1.0, 3.0]);
        assert_eq!(range([4.0].into_iter()), [3.5, 4.5]);
        assert_eq!(range([].into_iter()), [0.0, 1.0]);
    }
}
