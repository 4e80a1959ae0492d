//! Line charts and histograms as SVG.

use std::fmt::Write;

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

/// A chart of several series; `y_range` where it shall not follow from the points.
pub(super) fn chart(
    x_label: &str,
    y_label: &str,
    series: &[Series],
    y_range: Option<[f64; 2]>,
) -> String {
    let points = || series.iter().flat_map(|s| &s.points);
    let x_range = range(points().map(|p| p[0]));
    let y_range = y_range.unwrap_or_else(|| range(points().map(|p| p[1])));
    let x = |v: f64| LEFT + (v - x_range[0]) / (x_range[1] - x_range[0]) * (WIDTH - LEFT - RIGHT);
    // Bands end at the axes.
    let y = |v: f64| {
        let v = v.clamp(y_range[0], y_range[1]);
        HEIGHT - BOTTOM - (v - y_range[0]) / (y_range[1] - y_range[0]) * (HEIGHT - TOP - BOTTOM)
    };
    let mut svg = format!(
        "<svg viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\" aria-label=\"{y_label} against {x_label}\">"
    );
    let mut add = |text: std::fmt::Arguments| svg.write_fmt(text).expect("memory takes all");
    for v in ticks(x_range) {
        add(format_args!(
            "<path class=\"grid\" d=\"M{0:.1} {TOP}V{1}\"/><text x=\"{0:.1}\" y=\"{2}\" text-anchor=\"middle\">{3}</text>",
            x(v),
            HEIGHT - BOTTOM,
            HEIGHT - BOTTOM + 14.0,
            number(v)
        ));
    }
    for v in ticks(y_range) {
        add(format_args!(
            "<path class=\"grid\" d=\"M{LEFT} {0:.1}H{1}\"/><text x=\"{2}\" y=\"{0:.1}\" dy=\"4\" text-anchor=\"end\">{3}</text>",
            y(v),
            WIDTH - RIGHT,
            LEFT - 5.0,
            number(v)
        ));
    }
    add(format_args!(
        "<text x=\"{}\" y=\"{}\" text-anchor=\"middle\">{x_label}</text>",
        (LEFT + WIDTH - RIGHT) / 2.0,
        HEIGHT - 8.0
    ));
    add(format_args!(
        "<text transform=\"translate(12 {}) rotate(-90)\" text-anchor=\"middle\">{y_label}</text>",
        (TOP + HEIGHT - BOTTOM) / 2.0
    ));
    for (i, one) in series.iter().enumerate() {
        let colour = COLOURS[i % COLOURS.len()];
        if one.points.is_empty() {
            continue;
        }
        let at = |[px, py]: [f64; 2]| format!("{:.1} {:.1}", x(px), y(py));
        if one.spread.len() == one.points.len() && one.spread.iter().any(|s| *s > 0.0) {
            let edge = |sign: f64| {
                one.points
                    .iter()
                    .zip(&one.spread)
                    .map(move |(p, s)| [p[0], p[1] + sign * s])
            };
            let band: Vec<_> = edge(1.0).chain(edge(-1.0).rev()).map(at).collect();
            add(format_args!(
                "<path d=\"M{}Z\" fill=\"{colour}\" opacity=\".2\"/>",
                band.join("L")
            ));
        }
        let line: Vec<_> = one.points.iter().copied().map(at).collect();
        add(format_args!(
            "<path d=\"M{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"1.6\"/>",
            line.join("L")
        ));
        for mark in &one.marked {
            add(format_args!(
                "<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"5\" fill=\"none\" stroke=\"#c00\" stroke-width=\"2\"/>",
                x(mark[0]),
                y(mark[1])
            ));
        }
    }
    svg += "</svg><p class=\"legend\">";
    for (i, one) in series.iter().enumerate() {
        let colour = COLOURS[i % COLOURS.len()];
        svg += &format!(
            "<span><i style=\"background:{colour}\"></i>{}</span> ",
            one.name
        );
    }
    svg + "</p>"
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
        let svg = chart("x", "y", &[series], None);
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
