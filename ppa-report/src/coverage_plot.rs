//! Plot of possible camera positions, and the share of a joint seen from each.

use image::RgbImage;
use plotters::coord::Shift;
use plotters::prelude::*;
use ppa_depth::{Coverage, Viewpoint};

use crate::chart::pixels::{FONT, Pixels, SCALE, picture};

/// A camera position relative to the joint, and what the camera sees from there.
#[derive(Debug, Clone, Copy)]
pub struct RankedView {
    /// Position of the camera.
    pub viewpoint: Viewpoint,
    /// Visible part of the joint.
    pub coverage: Coverage,
}

/// Columns and rows.
const SIZE: [u32; 2] = [1160, 600];
const BACKGROUND: RGBColor = RGBColor(24, 24, 24);
const INK: RGBColor = RGBColor(235, 235, 235);
const FAINT: RGBColor = RGBColor(90, 90, 90);
/// Number of best places that are numbered.
const NUMBERED: usize = 5;
/// Radius of the smallest disc, pixels.
const DOT: i32 = 5;
/// Increase of the disc radius per further distance, pixels.
const RING: i32 = 4;

type Page<'a> = DrawingArea<Pixels<'a>, Shift>;
type Drawn<'a> = Result<(), DrawingAreaErrorKind<<Pixels<'a> as DrawingBackend>::ErrorType>>;

/// Draws views, the best first. Left: the sky above the joint, straight above in the middle, with a disc per camera that is larger
/// for larger distances and drawn below the nearer ones. Right: share of the surface against mm per pixel. Colours show the share.
pub fn coverage_plot(views: &[RankedView]) -> RgbImage {
    picture(SIZE, |page| {
        page.fill(&BACKGROUND)?;
        let (sky, shares) = page.split_horizontally(50.percent_width());
        draw_sky(&sky, views)?;
        draw_shares(&shares, views)
    })
}

fn font() -> TextStyle<'static> {
    TextStyle::from(("sans-serif", FONT).into_font()).color(&INK)
}

/// The largest share of the surface that a view sees.
fn largest_share(views: &[RankedView]) -> f64 {
    let shares = views.iter().map(|view| view.coverage.visible_share);
    shares.fold(0.01, f64::max)
}

fn colour(view: &RankedView, largest_share: f64) -> ShapeStyle {
    let t = view.coverage.visible_share / largest_share;
    let [r, g, b] = colorous::VIRIDIS.eval_continuous(t).into_array();
    RGBColor(r, g, b).filled()
}

/// Direction of a camera in the sky, degrees from straight above: to the right along x, up along y.
fn direction(viewpoint: &Viewpoint) -> (f64, f64) {
    let away = 90.0 - viewpoint.elevation_deg;
    let (sin, cos) = viewpoint.azimuth_deg.to_radians().sin_cos();
    (away * cos, away * sin)
}

fn draw_sky<'a>(page: &Page<'a>, views: &[RankedView]) -> Drawn<'a> {
    // The rim is the lowest elevation, at least the horizon.
    let elevations = views.iter().map(|view| view.viewpoint.elevation_deg);
    let rim = 1.05 * (90.0 - elevations.fold(0.0, f64::min));
    let mut sky = ChartBuilder::on(page)
        .margin_left(60 * SCALE)
        .margin_right(60 * SCALE)
        .margin_top(70 * SCALE)
        .margin_bottom(70 * SCALE)
        .build_cartesian_2d(-rim..rim, -rim..rim)?;
    for elevation in [0.0, 30.0, 60.0] {
        let turn = |n: i32| f64::from(n).to_radians().sin_cos();
        let circle = (0..=360).map(turn);
        let circle = circle.map(|(sin, cos)| ((90.0 - elevation) * cos, (90.0 - elevation) * sin));
        let line = FAINT.stroke_width(SCALE as u32);
        sky.draw_series([PathElement::new(circle.collect::<Vec<_>>(), line)])?;
    }
    let rounded = |view: &RankedView| view.viewpoint.distance_mm.round();
    let mut distances: Vec<f64> = views.iter().map(rounded).collect();
    distances.sort_by(f64::total_cmp);
    distances.dedup();
    // More than a few distances come from places in a file, which need no rings.
    let has_rings = distances.len() <= 6;
    let size = |view: &RankedView| {
        let nth = distances.iter().position(|d| *d == rounded(view));
        DOT + if has_rings {
            RING * nth.unwrap_or(0) as i32
        } else {
            0
        }
    };
    let mut order: Vec<&RankedView> = views.iter().collect();
    order.sort_by(|a, b| b.viewpoint.distance_mm.total_cmp(&a.viewpoint.distance_mm));
    let largest = largest_share(views);
    sky.draw_series(order.into_iter().map(|view| {
        let place = direction(&view.viewpoint);
        Circle::new(place, size(view) * SCALE, colour(view, largest))
    }))?;
    number(page, views, |view| {
        Some((sky.backend_coord(&direction(&view.viewpoint)), size(view)))
    })?;
    let left = 60 * SCALE;
    let text = |text: &str, y: i32| page.draw_text(text, &font(), (left, y * SCALE));
    text("camera seen from the joint; up: y, right: x", 18)?;
    text("circles: 0, 30, 60 degrees up", SIZE[1] as i32 - 40)?;
    if has_rings {
        let distances: Vec<String> = distances.iter().map(f64::to_string).collect();
        let discs = format!(
            "discs from small to large: {} mm away",
            distances.join(", ")
        );
        text(&discs, 36)?;
    }
    Ok(())
}

fn draw_shares<'a>(page: &Page<'a>, views: &[RankedView]) -> Drawn<'a> {
    let largest = largest_share(views);
    let coarsest = views.iter().filter_map(|view| view.coverage.mm_per_pixel);
    let mut axes = ChartBuilder::on(page)
        .margin(40 * SCALE)
        .x_label_area_size(40 * SCALE)
        .y_label_area_size(50 * SCALE)
        .build_cartesian_2d(
            0.0..1.05 * coarsest.fold(0.5, f64::max),
            0.0..105.0 * largest,
        )?;
    let number_text = |value: &f64| format!("{}", (value * 100.0).round() / 100.0);
    axes.configure_mesh()
        .bold_line_style(FAINT.stroke_width(SCALE as u32))
        .light_line_style(TRANSPARENT)
        .axis_style(FAINT.stroke_width(SCALE as u32))
        .x_label_formatter(&number_text)
        .y_label_formatter(&number_text)
        .label_style(font())
        .axis_desc_style(font())
        .x_desc("mm per pixel")
        .y_desc("visible share of the joint's surface, %")
        .draw()?;
    let place = |view: &RankedView| {
        let mm = view.coverage.mm_per_pixel?;
        Some((mm, 100.0 * view.coverage.visible_share))
    };
    let discs = views
        .iter()
        .rev()
        .filter_map(|view| Some((place(view)?, view)));
    axes.draw_series(
        discs.map(|(place, view)| Circle::new(place, (DOT - 1) * SCALE, colour(view, largest))),
    )?;
    number(page, views, |view| {
        Some((axes.backend_coord(&place(view)?), DOT))
    })
}

/// Circles and numbers the best views; numbers of the same place are written side by side. `place` returns a position on the canvas
/// and the radius of its disc.
fn number<'a>(
    page: &Page<'a>,
    views: &[RankedView],
    place: impl Fn(&RankedView) -> Option<((i32, i32), i32)>,
) -> Drawn<'a> {
    let corner = page.get_base_pixel();
    let mut written: Vec<(i32, i32)> = Vec::new();
    for (rank, view) in views.iter().enumerate().take(NUMBERED) {
        let Some(((x, y), radius)) = place(view) else {
            continue;
        };
        let (x, y) = (x - corner.0, y - corner.1);
        let ring = INK.stroke_width(3 * SCALE as u32 / 2);
        page.draw(&Circle::new((x, y), (radius + 2) * SCALE, ring))?;
        let near = |(a, b): &&(i32, i32)| (a - x).pow(2) + (b - y).pow(2) < (10 * SCALE).pow(2);
        let beside = 10 * written.iter().filter(near).count() as i32;
        let at = (x + (DOT + 12 + beside) * SCALE, y - 12 * SCALE);
        page.draw_text(&format!("{}", rank + 1), &font(), at)?;
        written.push((x, y));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A camera at x is to the right of the middle, one at y above it; a larger share of the surface is brighter.
    #[test]
    fn places_and_colours_are_those_of_the_views() {
        let view = |azimuth_deg, visible_share| RankedView {
            viewpoint: Viewpoint {
                azimuth_deg,
                elevation_deg: 30.0,
                distance_mm: 900.0,
            },
            coverage: Coverage {
                visible_mm2: 1e4 * visible_share,
                visible_share,
                pixels: 1e3,
                pixels_per_cm2: 10.0,
                mm_per_pixel: Some(2.0),
            },
        };
        let sheet = coverage_plot(&[view(0.0, 0.4), view(90.0, 0.1)]);
        // The panel of the sky has sides of 460 pixels; its rim is at 94.5 degrees.
        let away = 60.0 / 94.5 * 230.0;
        let at = |x: f64, y: f64| sheet.get_pixel(x as u32, y as u32).0;
        let (right, top) = (at(290.0 + away, 300.0), at(290.0, 300.0 - away));
        assert_eq!(right, colorous::VIRIDIS.eval_continuous(1.0).into_array());
        assert_eq!(top, colorous::VIRIDIS.eval_continuous(0.25).into_array());
    }
}
