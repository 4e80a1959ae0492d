//! Parts of a surface become one mesh.

use nalgebra::Vector3;

use super::SurfaceError;
use super::march::Part;
use super::numbers::{AT_VOXEL, KIND_SHIFT};
use super::points::Points;
use crate::mesh::Mesh;

/// Numbers from here on would have the bits of another kind.
const MOST_VERTICES: usize = AT_VOXEL as usize;

/// All crossings, then all voxels that are vertices, then all extra vertices, each part behind the one before.
pub fn join(mut parts: Vec<Part>, mirrored: bool) -> Result<Mesh, SurfaceError> {
    let kinds: [fn(&Part) -> &Points; 3] = [|p| &p.crossings, |p| &p.at_voxels, |p| &p.extra];
    let mut first = [0; 3];
    let mut count = 0;
    for (first, points) in first.iter_mut().zip(&kinds) {
        *first = count;
        count += (parts.iter().map(|part| points(part).vertices.len())).sum::<usize>();
    }
    if count >= MOST_VERTICES {
        return Err(SurfaceError::TooLarge);
    }
    let mut points = std::mem::take(&mut parts[0].crossings);
    let own = points.vertices.len();
    let mut triangles = std::mem::take(&mut parts[0].triangles);
    let append_points = || {
        for (kind, of) in kinds.iter().enumerate() {
            for part in &parts[usize::from(kind == 0)..] {
                points.extend_from(of(part));
            }
        }
        points
    };
    let append_triangles = || {
        let mut first = first.map(|first| first as u32);
        for (at, part) in parts.iter().enumerate() {
            let number = |id: u32| first[(id >> KIND_SHIFT) as usize] + (id & (AT_VOXEL - 1));
            if at == 0 {
                for &marked in &part.marked {
                    triangles[marked] = triangles[marked].map(number);
                }
            } else {
                triangles.extend(part.triangles.iter().map(|triangle| triangle.map(number)));
            }
            let crossings = if at == 0 {
                own
            } else {
                part.crossings.vertices.len()
            };
            first[0] += crossings as u32;
            first[1] += part.at_voxels.vertices.len() as u32;
            first[2] += part.extra.vertices.len() as u32;
        }
        if mirrored {
            for triangle in &mut triangles {
                triangle.swap(1, 2);
            }
        }
        triangles
    };
    let (points, triangles) = rayon::join(append_points, append_triangles);
    let mut mesh = Mesh {
        vertices: points.vertices,
        normals: points.normals,
        triangles,
    };
    fill_flat_normals(&mut mesh);
    Ok(mesh)
}

/// Where the gradient vanishes (a plateau at the iso value) the triangles say what is outward.
fn fill_flat_normals(mesh: &mut Mesh) {
    if mesh.normals.iter().all(|n| *n != Vector3::zeros()) {
        return;
    }
    let geometric = mesh.geometric_normals();
    for (normal, replacement) in mesh.normals.iter_mut().zip(geometric) {
        if *normal == Vector3::zeros() {
            *normal = replacement;
        }
    }
}
