//! The colour scale of depths.

use maud::{Markup, html};
use plotters::coord::ranged1d::Ranged;
use plotters::coord::types::RangedCoordf64;
use ppa_core::text::number;
use ppa_depth::false_colour;

const WIDTH: f64 = 460.0;
const HEIGHT: f64 = 46.0;
const LEFT: f64 = 12.0;
/// End of the bar; to its right is the colour of pixels without depth.
const RIGHT: f64 = 352.0;
const STEPS: u32 = 68;

/// A bar of the colours over a range of depths, with ticks in mm, and the colour of pixels without depth, as SVG.
pub(super) fn colour_scale(range_mm: [f64; 2]) -> Markup {
    let [near, far] = range_mm;
    let at = |share: f64| LEFT + share * (RIGHT - LEFT);
    let width = (RIGHT - LEFT) / f64::from(STEPS);
    let steps = (0..STEPS).map(|step| (f64::from(step) + 0.5) / f64::from(STEPS));
    let steps = steps.map(|share| {
        let [r, g, b] = false_colour(near + share * (far - near), range_mm);
        let left = format!("{:.2}", at(share) - width / 2.0);
        (left, format!("#{r:02x}{g:02x}{b:02x}"))
    });
    // As many as in a chart of this width.
    let ticks = RangedCoordf64::from(near..far).key_points(8).into_iter();
    let ticks = ticks.map(|tick| {
        (
            format!("{:.1}", at((tick - near) / (far - near))),
            number(tick),
        )
    });
    html! {
        svg class="scale" viewBox={ "0 0 " (WIDTH) " " (HEIGHT) } role="img"
            aria-label=(format!("colours of depths from {near:.0} to {far:.0} mm")) {
            @for (left, colour) in steps {
                // Half a pixel wider, to avoid gaps between neighbours.
                rect x=(left) y="2" width=(format!("{:.2}", width + 0.5)) height="16" fill=(colour) {}
            }
            @for (x, text) in ticks {
                path d={ "M" (x) " 18v5" } stroke="#333" {}
                text x=(x) y="35" text-anchor="middle" { (text) }
            }
            text x=(RIGHT + 6.0) y="15" { "mm" }
            rect x=(RIGHT + 34.0) y="2" width="16" height="16" fill="#000" {}
            text x=(RIGHT + 55.0) y="15" { "no depth" }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_and_ticks_are_those_of_the_images() {
        let svg = colour_scale([700.0, 1000.0]).into_string();
        let [r, g, b] = false_colour(700.0 + 150.0 / 68.0, [700.0, 1000.0]);
        assert!(
            svg.contains(&format!("fill=\"#{r:02x}{g:02x}{b:02x}\"")),
            "{svg}"
        );
        // 850 is in the middle of the bar, from 12 to 352.
        let at = |tick: &str| format!("x=\"{tick}\" y=\"35\"");
        assert!(
            svg.contains(&format!("{} text-anchor=\"middle\">900<", at("238.7"))),
            "{svg}"
        );
        assert!(svg.contains("no depth"));
    }
}
