//! A slice of the scan through the joint, with skin, axis, regions and plane.

use nalgebra::{Affine3, Point3, Vector3};
use ppa_ct::Grid;
use ppa_generate::PreparedLimb;
use ppa_mesh::Mesh;

use super::canvas::{Canvas, Rect, mixed};
use super::limb_marks::LimbMarks;
use super::palette::{OUTLINE, PANEL};
use super::panel;
use super::view::View;

/// HU shown as black and white.
const WINDOW_HU: [f64; 2] = [-450.0, 1050.0];

/// How far voxels outside the limb fade into the panel's background.
const FADED: f64 = 0.55;

/// Draws the slice through the joint whose axes are `right` and `up`, ct frame.
pub(super) fn draw_slice(
    canvas: &mut Canvas,
    rect: Rect,
    limb: &PreparedLimb,
    marks: &LimbMarks,
    (title, right, up): (&str, Vector3<f64>, Vector3<f64>),
) {
    panel::ground(canvas, rect);
    let skin = &limb.limb.mesh;
    let points = skin.vertices.iter().map(|p| p.cast::<f64>());
    let view = View::fitting(rect, [right, up], points).through(&marks.joint());
    canvas.within(rect, |canvas| {
        draw_voxels(canvas, rect, limb, marks, &view);
        for [from, to] in outline(skin, &view) {
            canvas.line(view.pixel(&from), view.pixel(&to), 1.5, OUTLINE);
        }
        marks.draw_plane(canvas, &view);
        marks.draw_axis(canvas, &view);
        marks.draw_joint(canvas, &view);
    });
    panel::title(canvas, rect, title);
    panel::orientation(canvas, rect, &view);
    panel::scale_bar(canvas, rect, &view);
}

fn draw_voxels(
    canvas: &mut Canvas,
    rect: Rect,
    limb: &PreparedLimb,
    marks: &LimbMarks,
    view: &View,
) {
    let grid = limb.volume.grid();
    let voxel_from_ct = grid.voxel_from_ct();
    let [black, white] = WINDOW_HU;
    let [[left, right], [top, bottom]] = rect.ends();
    for (x, y) in (top..bottom).flat_map(|y| (left..right).map(move |x| (x, y))) {
        let point = view.point([f64::from(x) + 0.5, f64::from(y) + 0.5], 0.0);
        let Some(hu) = limb.volume.sample(&point) else {
            continue;
        };
        let brightness = ((hu - black) / (white - black)).clamp(0.0, 1.0);
        let gray = [(255.0 * brightness).round() as u8; 3];
        let colour = match nearest_voxel(grid, &voxel_from_ct, &point) {
            Some(index) if limb.limb.mask[index] => marks.tinted(gray, &point),
            _ => mixed(gray, PANEL, FADED),
        };
        canvas.blend(x, y, colour, 1.0);
    }
}

fn nearest_voxel(grid: &Grid, voxel_from_ct: &Affine3<f64>, point: &Point3<f64>) -> Option<usize> {
    let at = (voxel_from_ct * point).coords.map(f64::round);
    let size = grid.size();
    let inside = (0..3).all(|axis| (0.0..size[axis] as f64).contains(&at[axis]));
    inside.then(|| grid.index([0, 1, 2].map(|axis| at[axis] as usize)))
}

/// Intersection of a mesh with the plane of nearness 0.
fn outline(mesh: &Mesh, view: &View) -> Vec<[Point3<f64>; 2]> {
    let nearness: Vec<f64> = mesh
        .vertices
        .iter()
        .map(|v| view.nearness(&v.cast()))
        .collect();
    let mut pieces = Vec::new();
    for triangle in &mesh.triangles {
        let at = triangle.map(|corner| nearness[corner as usize]);
        let is_before = at.map(|near| near > 0.0);
        if is_before == [true; 3] || is_before == [false; 3] {
            continue;
        }
        let corner = |i: usize| mesh.vertices[triangle[i] as usize].cast::<f64>();
        let mut crossings = [(0, 1), (1, 2), (2, 0)]
            .into_iter()
            .filter(|(a, b)| is_before[*a] != is_before[*b])
            .map(|(a, b)| corner(a) + (corner(b) - corner(a)) * (at[a] / (at[a] - at[b])));
        if let (Some(from), Some(to)) = (crossings.next(), crossings.next()) {
            pieces.push([from, to]);
        }
    }
    pieces
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_outline_of_a_tetrahedron_is_a_closed_triangle() {
        let mesh = Mesh {
            vertices: [
                [0.0, 0.0, 0.0],
                [4.0, 0.0, 0.0],
                [0.0, 4.0, 0.0],
                [0.0, 0.0, 4.0],
            ]
            .map(|[x, y, z]: [f32; 3]| Point3::new(x, y, z))
            .to_vec(),
            normals: vec![Vector3::z(); 4],
            triangles: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]],
        };
        let rect = Rect {
            x: 0,
            y: 0,
            width: 50,
            height: 50,
        };
        let corners = mesh.vertices.iter().map(|p| p.cast::<f64>());
        let view = View::fitting(rect, [Vector3::x(), Vector3::y()], corners);
        let pieces = outline(&mesh, &view.through(&Point3::new(0.0, 0.0, 1.0)));
        assert_eq!(pieces.len(), 3);
        let length: f64 = pieces.iter().map(|[a, b]| (b - a).norm()).sum();
        assert!((length - (6.0 + 18.0_f64.sqrt())).abs() < 1e-5, "{length}");
    }
}
