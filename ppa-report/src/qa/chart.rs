//! Line charts and histograms as SVG.

use maud::{Markup, html};
use ppa_core::text::number;

const WIDTH: f64 = 460.0;
const HEIGHT: f64 = 240.0;
const LEFT: f64 = 52.0;
const RIGHT: f64 = 12.0;
const TOP: f64 = 14.0;
const BOTTOM: f64 = 40.0;

/// Colours that people with any colour vision distinguish (Okabe and Ito 2008).
pub(super) const COLOURS: [&str; 6] = [
    "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9",
];

/// One curve, or the outline of one histogram.
pub(super) struct Series {
    pub name: String,
    /// x and y, in order of x.
    pub points: Vec<[f64; 2]>,
    /// Half the height of a band around each point; empty for none.
    pub spread: Vec<f64>,
    /// Points to ring.
    pub marked: Vec<[f64; 2]>,
}

impl Series {
    /// The outline of the band around the points, where there is one.
    fn band(&self) -> Option<Vec<[f64; 2]>> {
        let is_there =
            self.spread.len() == self.points.len() && self.spread.iter().any(|s| *s > 0.0);
        let edge = |sign: f64| {
            let points = self.points.iter().zip(&self.spread);
            points.map(move |(p, s)| [p[0], p[1] + sign * s])
        };
        is_there.then(|| edge(1.0).chain(edge(-1.0).rev()).collect())
    }
}

/// A chart of several series; `y_range` where it shall not follow from the points.
pub(super) fn chart(
    x_label: &str,
    y_label: &str,
    series: &[Series],
    y_range: Option<[f64; 2]>,
) -> Markup {
    let points = || series.iter().flat_map(|s| &s.points);
    let x_range = range(points().map(|p| p[0]));
    let y_range = y_range.unwrap_or_else(|| range(points().map(|p| p[1])));
    let x = |v: f64| LEFT + (v - x_range[0]) / (x_range[1] - x_range[0]) * (WIDTH - LEFT - RIGHT);
    // Bands end at the axes.
    let y = |v: f64| {
        let v = v.clamp(y_range[0], y_range[1]);
        HEIGHT - BOTTOM - (v - y_range[0]) / (y_range[1] - y_range[0]) * (HEIGHT - TOP - BOTTOM)
    };
    let [bottom, right] = [HEIGHT - BOTTOM, WIDTH - RIGHT];
    let at = |[px, py]: [f64; 2]| format!("{:.1} {:.1}", x(px), y(py));
    let path = |points: Vec<String>| format!("M{}", points.join("L"));
    let drawn = || series.iter().zip(COLOURS.iter().cycle());
    html! {
        svg viewBox={ "0 0 " (WIDTH) " " (HEIGHT) } role="img" aria-label={ (y_label) " against " (x_label) } {
            @for (at, text) in ticks(x_range).into_iter().map(|v| (format!("{:.1}", x(v)), number(v))) {
                path class="grid" d={ "M" (at) " " (TOP) "V" (bottom) } {}
                text x=(at) y=(bottom + 14.0) text-anchor="middle" { (text) }
            }
            @for (at, text) in ticks(y_range).into_iter().map(|v| (format!("{:.1}", y(v)), number(v))) {
                path class="grid" d={ "M" (LEFT) " " (at) "H" (right) } {}
                text x=(LEFT - 5.0) y=(at) dy="4" text-anchor="end" { (text) }
            }
            text x=((LEFT + right) / 2.0) y=(HEIGHT - 8.0) text-anchor="middle" { (x_label) }
            text transform={ "translate(12 " ((TOP + bottom) / 2.0) ") rotate(-90)" } text-anchor="middle" { (y_label) }
            @for (one, colour) in drawn().filter(|(one, _)| !one.points.is_empty()) {
                @if let Some(band) = one.band() {
                    path d={ (path(band.into_iter().map(at).collect())) "Z" } fill=(colour) opacity=".2" {}
                }
                path d=(path(one.points.iter().copied().map(at).collect())) fill="none" stroke=(colour) stroke-width="1.6" {}
                @for mark in &one.marked {
                    circle cx=(format!("{:.1}", x(mark[0]))) cy=(format!("{:.1}", y(mark[1]))) r="5" fill="none" stroke="#c00" stroke-width="2" {}
                }
            }
        }
        p class="legend" {
            @for (one, colour) in drawn() {
                span { i style={ "background:" (colour) } {} (one.name) } " "
            }
        }
    }
}

/// Least and greatest value, never the same.
fn range(values: impl Iterator<Item = f64>) -> [f64; 2] {
    let [low, high] = values.fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], v| {
        [l.min(v), h.max(v)]
    });
    match high - low {
        span if span > 0.0 => [low, high],
        _ if low.is_finite() => [low - 0.5, high + 0.5],
        _ => [0.0, 1.0],
    }
}

/// Round numbers within a range, four to nine of them.
pub(super) fn ticks([low, high]: [f64; 2]) -> Vec<f64> {
    let rough = (high - low) / 5.0;
    let power = 10_f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0]
        .map(|m| m * power)
        .into_iter()
        .find(|s| *s >= rough);
    let step = step.unwrap_or(power);
    let (first, last) = (
        (low / step - 1e-9).ceil() as i64,
        (high / step + 1e-9).floor() as i64,
    );
    // Whole multiples of a power of ten would show as 0.30000000000000004.
    let rounded = |v: f64| format!("{v:.9}").parse().unwrap_or(v);
    (first..=last).map(|i| rounded(i as f64 * step)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_within_the_range() {
        assert_eq!(ticks([0.0, 90.0]), [0.0, 20.0, 40.0, 60.0, 80.0]);
        assert_eq!(ticks([1.0, 3.0]), [1.0, 1.5, 2.0, 2.5, 3.0]);
        assert_eq!(ticks([-0.31, 0.42]), [-0.2, 0.0, 0.2, 0.4]);
        assert_eq!(range([4.0].into_iter()), [3.5, 4.5]);
        assert_eq!(range([].into_iter()), [0.0, 1.0]);
    }

    #[test]
    fn a_point_lies_where_its_axes_say() {
        let points = vec![[0.0, 1.0], [10.0, 3.0]];
        let series = Series {
            name: "a".to_owned(),
            points,
            spread: Vec::new(),
            marked: vec![[10.0, 3.0]],
        };
        let svg = chart("x", "y", &[series], None).into_string();
        let (right, top) = (WIDTH - RIGHT, TOP);
        assert!(
            svg.contains(&format!(
                "M{LEFT:.1} {:.1}L{right:.1} {top:.1}",
                HEIGHT - BOTTOM
            )),
            "{svg}"
        );
        assert!(
            svg.contains(&format!("cx=\"{right:.1}\" cy=\"{top:.1}\"")),
            "{svg}"
        );
    }
}
