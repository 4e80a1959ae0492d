//! Charts as parts of the page.

use maud::{Markup, PreEscaped, html};

use crate::chart::{Chart, Series, range};

/// A chart of several series; `y_range` if it should not follow from the points.
pub(super) fn chart(
    x_label: &str,
    y_label: &str,
    series: Vec<Series>,
    y_range: Option<[f64; 2]>,
) -> Markup {
    let of = |axis: usize| range(series.iter().flat_map(|s| &s.points).map(|p| p[axis]));
    let chart = Chart {
        size: [360, 250],
        title: String::new(),
        labels: [x_label, y_label].map(str::to_owned),
        ranges: [of(0), y_range.unwrap_or_else(|| of(1))],
        tiles: Vec::new(),
        series,
    };
    html! {
        div role="img" aria-label={ (y_label) " against " (x_label) } { (PreEscaped(chart.to_inline_svg())) }
    }
}
