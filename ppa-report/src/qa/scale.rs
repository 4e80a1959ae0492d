//! The colours of depths, with their values.

use std::fmt::Write;

use ppa_core::text::number;
use ppa_depth::false_colour;

use super::chart::ticks;

const WIDTH: f64 = 460.0;
const HEIGHT: f64 = 46.0;
const LEFT: f64 = 12.0;
/// End of the bar; right of it stands the colour of pixels without depth.
const RIGHT: f64 = 352.0;
const STEPS: u32 = 68;

/// A bar of the colours over a range of depths, with ticks in mm, and the colour of pixels without depth, as SVG.
pub(super) fn colour_scale(range_mm: [f64; 2]) -> String {
    let [near, far] = range_mm;
    let at = |share: f64| LEFT + share * (RIGHT - LEFT);
    let mut svg = format!(
        "<svg class=\"scale\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\" aria-label=\"colours of depths from {near:.0} to {far:.0} mm\">"
    );
    let width = (RIGHT - LEFT) / f64::from(STEPS);
    for step in 0..STEPS {
        let share = (f64::from(step) + 0.5) / f64::from(STEPS);
        let [r, g, b] = false_colour(near + share * (far - near), range_mm);
        // Half a pixel wider, so that no gaps show between neighbours.
        let _ = write!(
            svg,
            "<rect x=\"{:.2}\" y=\"2\" width=\"{:.2}\" height=\"16\" fill=\"#{r:02x}{g:02x}{b:02x}\"/>",
            at(share) - width / 2.0,
            width + 0.5
        );
    }
    for tick in ticks(range_mm) {
        let x = at((tick - near) / (far - near));
        let _ = write!(
            svg,
            "<path d=\"M{x:.1} 18v5\" stroke=\"#333\"/><text x=\"{x:.1}\" y=\"35\" text-anchor=\"middle\">{}</text>",
            number(tick)
        );
    }
    let _ = write!(
        svg,
        "<text x=\"{:.1}\" y=\"15\">mm</text><rect x=\"{:.1}\" y=\"2\" width=\"16\" height=\"16\" fill=\"#000\"/>\
         <text x=\"{:.1}\" y=\"15\">no depth</text></svg>",
        RIGHT + 6.0,
        RIGHT + 34.0,
        RIGHT + 55.0
    );
    svg
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_and_ticks_are_those_of_the_images() {
        let svg = colour_scale([700.0, 1000.0]);
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
