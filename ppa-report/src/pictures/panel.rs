//! Common parts of a panel: background, title, orientation letters, scale bar.

use super::canvas::{Canvas, GLYPH, Rect, text_width};
use super::palette::{INK, PANEL};
use super::view::{View, letters};

const MARGIN: u32 = 8;

/// Lengths of scale bars, mm.
const BARS_MM: [f64; 8] = [5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0];

/// Fills the background of a panel.
pub(super) fn ground(canvas: &mut Canvas, rect: Rect) {
    canvas.fill(rect, PANEL);
}

/// Writes the title in the upper left corner.
pub(super) fn title(canvas: &mut Canvas, rect: Rect, text: &str) {
    canvas.text(text, [rect.x + MARGIN, rect.y + MARGIN], 2, INK);
}

/// Writes the orientation letters of the ct frame at the four edges.
pub(super) fn orientation(canvas: &mut Canvas, rect: Rect, view: &View) {
    let size = GLYPH * 2;
    let (middle_x, middle_y) = (rect.x + rect.width / 2, rect.y + rect.height / 2 - size / 2);
    let [left, right] = [letters(&-view.right), letters(&view.right)];
    let [top, bottom] = [letters(&view.up), letters(&-view.up)];
    let from_right = rect.x + rect.width - MARGIN - text_width(&right, 2);
    canvas.text(&left, [rect.x + MARGIN, middle_y], 2, INK);
    canvas.text(&right, [from_right, middle_y], 2, INK);
    let centred = |text: &str| middle_x - text_width(text, 2) / 2;
    // The title is in the first line.
    let below_title = rect.y + 2 * MARGIN + size;
    canvas.text(&top, [centred(&top), below_title], 2, INK);
    let lowest = rect.y + rect.height - MARGIN - size;
    canvas.text(&bottom, [centred(&bottom), lowest], 2, INK);
}

/// Draws a bar of a round length in the lower left corner, at most a third of the panel wide.
pub(super) fn scale_bar(canvas: &mut Canvas, rect: Rect, view: &View) {
    let most = f64::from(rect.width) / 3.0;
    let fits = |mm: &&f64| **mm * view.pixels_per_mm <= most;
    let Some(mm) = BARS_MM.iter().rev().find(fits) else {
        return;
    };
    let (x, y) = (
        f64::from(rect.x + MARGIN),
        f64::from(rect.y + rect.height - 14),
    );
    let end = x + mm * view.pixels_per_mm;
    for (width, colour) in [(6.0, [0; 3]), (3.0, INK)] {
        canvas.line([x, y], [end, y], width, colour);
        for tick in [x, end] {
            canvas.line([tick, y - 5.0], [tick, y + 5.0], width - 1.0, colour);
        }
    }
    let text = format!("{mm} mm");
    canvas.text(&text, [rect.x + MARGIN, rect.y + rect.height - 40], 2, INK);
}
