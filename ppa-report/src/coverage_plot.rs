//! Plot of possible camera positions, and the share of a joint seen from each.

use image::{Rgb, RgbImage};
use ppa_depth::{Coverage, Viewpoint};

use crate::drawing::{INK, draw_circle, fill_disc, write_text};

/// A camera's place seen from the joint, and what it sees from there.
#[derive(Debug, Clone, Copy)]
pub struct RankedView {
    /// Where it stands.
    pub viewpoint: Viewpoint,
    /// What it sees.
    pub coverage: Coverage,
}

const PANEL: f64 = 460.0;
const MARGIN: f64 = 60.0;
const HEIGHT: u32 = 600;
const FAINT: Rgb<u8> = Rgb([90; 3]);
/// Places that are numbered, from the best.
const NUMBERED: usize = 5;
/// Radius of the smallest disc, pixels.
const DOT: f64 = 5.0;
/// By which the disc of each further distance is larger, pixels.
const RING: f64 = 4.0;

/// Draws views, the best first: on the left the sky above the joint, straight above in the middle, with a disc per camera, larger
/// for larger distances and below the nearer ones; on the right share of the surface over mm per pixel. Colours show the share.
pub fn coverage_plot(views: &[RankedView]) -> RgbImage {
    let width = (2.0 * PANEL + 4.0 * MARGIN) as u32;
    let mut sheet = RgbImage::from_pixel(width, HEIGHT, Rgb([24; 3]));
    let most = views
        .iter()
        .map(|view| view.coverage.visible_share)
        .fold(0.01, f64::max);
    let colour = |view: &RankedView| {
        let t = view.coverage.visible_share / most;
        Rgb(colorous::VIRIDIS.eval_continuous(t).into_array())
    };
    draw_sky(&mut sheet, views, colour);
    draw_scatter(&mut sheet, views, most, colour);
    sheet
}

fn draw_sky(sheet: &mut RgbImage, views: &[RankedView], colour: impl Fn(&RankedView) -> Rgb<u8>) {
    let middle = [MARGIN + PANEL / 2.0, MARGIN + PANEL / 2.0];
    // Straight above is the middle; the rim is the lowest elevation, at least the horizon.
    let lowest = views
        .iter()
        .map(|view| view.viewpoint.elevation_deg)
        .fold(0.0, f64::min);
    let per_degree = (PANEL / 2.0 - 20.0) / (90.0 - lowest);
    for elevation in [0.0, 30.0, 60.0] {
        let radius = (90.0 - elevation) * per_degree;
        draw_circle(sheet, middle, radius, 1.0, FAINT);
    }
    let mut distances: Vec<f64> = views
        .iter()
        .map(|v| v.viewpoint.distance_mm.round())
        .collect();
    distances.sort_by(f64::total_cmp);
    distances.dedup();
    // More than a few distances are places from a file, which need no rings.
    let size = |view: &RankedView| {
        let at = |d: &f64| *d == view.viewpoint.distance_mm.round();
        match distances.iter().position(at) {
            Some(nth) if distances.len() <= 6 => DOT + RING * nth as f64,
            _ => DOT,
        }
    };
    let place = |view: &RankedView| {
        let away = (90.0 - view.viewpoint.elevation_deg) * per_degree;
        let (sin, cos) = view.viewpoint.azimuth_deg.to_radians().sin_cos();
        [middle[0] + away * cos, middle[1] - away * sin]
    };
    let mut order: Vec<&RankedView> = views.iter().collect();
    order.sort_by(|a, b| b.viewpoint.distance_mm.total_cmp(&a.viewpoint.distance_mm));
    for view in order {
        fill_disc(sheet, place(view), size(view), colour(view));
    }
    number(sheet, views, |view| Some((place(view), size(view))));
    write_text(
        sheet,
        "camera seen from the joint; up: y, right: x",
        MARGIN as u32,
        20,
        1,
    );
    let circles = "circles: 0, 30, 60 degrees up";
    write_text(sheet, circles, MARGIN as u32, HEIGHT - 40, 1);
    if distances.len() <= 6 {
        let texts: Vec<String> = distances.iter().map(|d| format!("{d}")).collect();
        let legend = format!("discs from small to large: {} mm away", texts.join(", "));
        write_text(sheet, &legend, MARGIN as u32, 36, 1);
    }
}

fn draw_scatter(
    sheet: &mut RgbImage,
    views: &[RankedView],
    most: f64,
    colour: impl Fn(&RankedView) -> Rgb<u8>,
) {
    let (left, top) = (3.0 * MARGIN + PANEL, MARGIN);
    let coarsest = views
        .iter()
        .filter_map(|view| view.coverage.mm_per_pixel)
        .fold(0.5, f64::max);
    let x_step = step_for(coarsest);
    let y_step = step_for(100.0 * most);
    let x_end = (coarsest / x_step).ceil() * x_step;
    let y_end = (100.0 * most / y_step).ceil() * y_step;
    let at = |mm: f64, percent: f64| {
        [
            left + mm / x_end * PANEL,
            top + PANEL - percent / y_end * PANEL,
        ]
    };
    for i in 0..=(x_end / x_step).round() as u32 {
        let mm = f64::from(i) * x_step;
        line(sheet, at(mm, 0.0), at(mm, y_end));
        let [x, y] = at(mm, 0.0);
        write_text(sheet, &short(mm), x as u32 - 8, y as u32 + 8, 1);
    }
    for i in 0..=(y_end / y_step).round() as u32 {
        let percent = f64::from(i) * y_step;
        line(sheet, at(0.0, percent), at(x_end, percent));
        let [x, y] = at(0.0, percent);
        write_text(sheet, &short(percent), x as u32 - 36, y as u32 - 4, 1);
    }
    let place = |view: &RankedView| {
        let mm = view.coverage.mm_per_pixel?;
        Some(at(mm, 100.0 * view.coverage.visible_share))
    };
    for view in views.iter().rev() {
        if let Some(place) = place(view) {
            fill_disc(sheet, place, DOT - 1.0, colour(view));
        }
    }
    number(sheet, views, |view| Some((place(view)?, DOT)));
    write_text(
        sheet,
        "visible share of the joint's surface, %",
        left as u32,
        20,
        1,
    );
    write_text(
        sheet,
        "mm per pixel",
        (left + PANEL / 2.0) as u32 - 48,
        (top + PANEL) as u32 + 28,
        1,
    );
}

/// Circles and numbers the best; numbers of one place stand side by side.
fn number(
    sheet: &mut RgbImage,
    views: &[RankedView],
    place: impl Fn(&RankedView) -> Option<([f64; 2], f64)>,
) {
    let mut written: Vec<[f64; 2]> = Vec::new();
    for (rank, view) in views.iter().enumerate().take(NUMBERED) {
        if let Some((at @ [x, y], radius)) = place(view) {
            draw_circle(sheet, at, radius + 2.0, 1.5, INK);
            let near = |[a, b]: &&[f64; 2]| (a - x).hypot(b - y) < 10.0;
            let beside = 10.0 * written.iter().filter(near).count() as f64;
            let text = format!("{}", rank + 1);
            write_text(
                sheet,
                &text,
                (x + DOT + beside) as u32 + 12,
                y as u32 - 12,
                1,
            );
            written.push(at);
        }
    }
}

/// A horizontal or vertical line.
fn line(sheet: &mut RgbImage, from: [f64; 2], to: [f64; 2]) {
    let range = |i: usize| from[i].min(to[i]).round() as u32..=from[i].max(to[i]).round() as u32;
    for (x, y) in range(1).flat_map(|y| range(0).map(move |x| (x, y))) {
        sheet.put_pixel(x, y, FAINT);
    }
}

/// A round step between 4 and 10 of which reach `end`.
fn step_for(end: f64) -> f64 {
    let power = 10.0_f64.powf(end.log10().floor());
    let steps = [0.1, 0.2, 0.5, 1.0].map(|share| share * power);
    steps
        .into_iter()
        .find(|step| end <= 10.0 * step)
        .unwrap_or(power)
}

/// A number of a scale without the dust of rounding.
fn short(value: f64) -> String {
    format!("{}", (value * 100.0).round() / 100.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scales_have_round_steps() {
        let steps = [0.9, 1.0, 3.4, 7.0, 45.0].map(step_for);
        for (found, expected) in steps.iter().zip([0.1, 0.1, 0.5, 1.0, 5.0]) {
            assert!((found / expected - 1.0).abs() < 1e-9, "{steps:?}");
        }
    }

    /// A camera at x lies to the right of the middle, one at y above it; more of the surface is brighter.
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
        let middle = MARGIN + PANEL / 2.0;
        let away = 60.0 * (PANEL / 2.0 - 20.0) / 90.0;
        let at = |x: f64, y: f64| sheet.get_pixel(x as u32, y as u32).0;
        let (right, top) = (at(middle + away, middle), at(middle, middle - away));
        assert_eq!(right, colorous::VIRIDIS.eval_continuous(1.0).into_array());
        assert_eq!(top, colorous::VIRIDIS.eval_continuous(0.25).into_array());
    }
}
