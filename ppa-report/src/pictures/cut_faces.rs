//! Surface where the field of view cuts a limb.

use nalgebra::{Point3, Vector3};
use ppa_ct::Grid;
use ppa_mesh::{Limb, Mesh};

/// Distance of the surface outside the skin's open edge, mm, so that it hides a wall in the same place.
const OUTSIDE_MM: f64 = 0.05;

/// One rectangle per voxel of the limb in a face of the volume that cuts it, ct frame, mm.
pub(super) fn cut_faces(limb: &Limb, grid: &Grid) -> Mesh {
    let mut mesh = Mesh::default();
    let (low, high) = (limb.report.low, limb.report.high);
    for face in &limb.report.cut_faces {
        let Some((axis, end)) = axis_and_end(&face.face) else {
            continue;
        };
        let layer = if end > 0.0 { high[axis] - 1 } else { low[axis] };
        let [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
        let normal = outward(grid, axis) * end;
        for (a, b) in (low[v]..high[v]).flat_map(|b| (low[u]..high[u]).map(move |a| (a, b))) {
            let mut voxel = [0; 3];
            (voxel[axis], voxel[u], voxel[v]) = (layer, a, b);
            if limb.mask[grid.index(voxel)] {
                rectangle(&mut mesh, grid, voxel, [u, v], &normal);
            }
        }
    }
    mesh
}

/// Axis and end of a face: `+j` is axis 1 at its upper end.
fn axis_and_end(face: &str) -> Option<(usize, f64)> {
    let end = if face.starts_with('-') { -1.0 } else { 1.0 };
    let axis = ["i", "j", "k"]
        .iter()
        .position(|axis| face.ends_with(*axis))?;
    Some((axis, end))
}

/// Unit normal of a grid's layers along an axis, towards larger indices; ct frame.
fn outward(grid: &Grid, axis: usize) -> Vector3<f64> {
    let affine = grid.ct_from_voxel().matrix();
    let column = |axis: usize| affine.fixed_view::<3, 1>(0, axis).into_owned();
    let normal = column((axis + 1) % 3).cross(&column((axis + 2) % 3));
    normal.normalize() * normal.dot(&column(axis)).signum()
}

fn rectangle(
    mesh: &mut Mesh,
    grid: &Grid,
    voxel: [usize; 3],
    [u, v]: [usize; 2],
    normal: &Vector3<f64>,
) {
    let first = mesh.vertices.len() as u32;
    for (du, dv) in [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)] {
        let mut at = voxel.map(|index| index as f64);
        at[u] += du;
        at[v] += dv;
        let corner: Point3<f64> = grid.centre(at) + normal * OUTSIDE_MM;
        mesh.vertices.push(corner.cast());
        mesh.normals.push(normal.cast());
    }
    mesh.triangles.push([first, first + 1, first + 2]);
    mesh.triangles.push([first, first + 2, first + 3]);
}

#[cfg(test)]
mod tests {
    use ppa_mesh::{CutFace, CutWalls, LimbReport};

    use super::*;

    #[test]
    fn a_cut_is_as_large_as_its_voxels_and_faces_outwards() {
        let grid = Grid::axis_aligned([4, 5, 6], Vector3::new(1.0, 2.0, 3.0), Point3::origin());
        let grid = grid.unwrap();
        let limb = Limb {
            mesh: Mesh::default(),
            walls: CutWalls::default(),
            mask: vec![true; grid.len()],
            report: LimbReport {
                low: [0; 3],
                high: [4, 5, 6],
                cut_faces: ["-j", "+k"]
                    .map(|face| CutFace {
                        face: face.to_owned(),
                        area_mm2: 0.0,
                    })
                    .to_vec(),
                ..LimbReport::default()
            },
        };
        let mesh = cut_faces(&limb, &grid);
        let expected = 4.0 * 6.0 * 3.0 + 4.0 * 5.0 * 2.0;
        assert!((mesh.area_mm2() - expected).abs() < 1e-3);
        let lowest = mesh
            .vertices
            .iter()
            .zip(&mesh.normals)
            .find(|(_, n)| n.y != 0.0);
        let (vertex, normal) = lowest.unwrap();
        assert!((normal.y + 1.0).abs() < 1e-6 && (vertex.y + 0.05).abs() < 1e-6);
    }
}
