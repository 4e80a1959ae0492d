//! A view of a limb's skin in the scan.

use nalgebra::Vector3;
use ppa_mesh::Mesh;

use super::canvas::{Canvas, Rect, mixed};
use super::limb_marks::LimbMarks;
use super::palette::{CUT, SKIN};
use super::panel;
use super::raster::Raster;
use super::view::View;

const SKIN_LAYER: u8 = 0;
const CUT_LAYER: u8 = 1;

/// Depth tolerance at which a point of the skin still counts as visible, mm.
const ON_SKIN_MM: f64 = 3.0;

/// Draws the skin and its cut faces, with `right` and `up` in the picture, ct frame.
pub(super) fn draw_skin(
    canvas: &mut Canvas,
    rect: Rect,
    [skin, cuts]: [&Mesh; 2],
    marks: &LimbMarks,
    (title, right, up): (&str, Vector3<f64>, Vector3<f64>),
) {
    panel::ground(canvas, rect);
    let points = skin.vertices.iter().map(|p| p.cast::<f64>());
    let view = View::fitting(rect, [right, up], points).through(&marks.joint());
    let mut raster = Raster::new(rect, view);
    raster.mesh(skin, SKIN_LAYER);
    raster.mesh(cuts, CUT_LAYER);
    raster.paint(canvas, |seen| {
        let colour = match (seen.layer, seen.from_behind) {
            (SKIN_LAYER, false) => marks.tinted(SKIN, &seen.point),
            // The inside of the skin is visible only where the skin is open.
            (SKIN_LAYER, true) => mixed(CUT, [0; 3], 0.4),
            _ => CUT,
        };
        raster.lit(colour, &seen.normal)
    });
    canvas.within(rect, |canvas| {
        marks.draw_plane(canvas, &view);
        marks.draw_axis(canvas, &view);
        marks.draw_plane_points(canvas, &view, |point| {
            let nearest = raster.nearness(view.pixel(point));
            nearest.is_some_and(|near| near > view.nearness(point) + ON_SKIN_MM)
        });
        marks.draw_joint(canvas, &view);
        marks.draw_findings(canvas, &view);
    });
    panel::title(canvas, rect, title);
    panel::orientation(canvas, rect, &view);
    panel::scale_bar(canvas, rect, &view);
}
