//! Joins parts of a surface into one mesh.

use std::ops::Range;

use nalgebra::Vector3;

use super::SurfaceError;
use super::march::Part;
use super::numbers::{AT_VOXEL, KIND_SHIFT};
use super::points::Points;
use crate::mesh::Mesh;

/// Vertex numbers from here on would have the bits of another kind.
const MOST_VERTICES: usize = AT_VOXEL as usize;

/// All crossings, then all voxels that are vertices, then all extra vertices, each part after the previous one.
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
        let mut marked = Vec::new();
        for (at, part) in parts.iter().enumerate() {
            let number = |id: u32| first[(id >> KIND_SHIFT) as usize] + (id & (AT_VOXEL - 1));
            if at == 0 {
                for &marked in &part.marked {
                    triangles[marked] = triangles[marked].map(number);
                }
                marked.extend_from_slice(&part.marked);
            } else {
                marked.extend(part.marked.iter().map(|marked| triangles.len() + marked));
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
        (triangles, marked)
    };
    let (points, (triangles, marked)) = rayon::join(append_points, append_triangles);
    let mut mesh = Mesh {
        vertices: points.vertices,
        normals: points.normals,
        triangles,
    };
    drop_lone_voxels(&mut mesh, &marked, first[1]..first[2]);
    fill_flat_normals(&mut mesh);
    Ok(mesh)
}

/// Drops voxels at the iso value whose triangles all degenerated, such as a single one in air.
/// `marked` are the triangles with vertices other than crossings.
fn drop_lone_voxels(mesh: &mut Mesh, marked: &[usize], voxels: Range<usize>) {
    let mut is_used = vec![false; voxels.len()];
    for id in marked.iter().flat_map(|&at| mesh.triangles[at]) {
        if voxels.contains(&(id as usize)) {
            is_used[id as usize - voxels.start] = true;
        }
    }
    if is_used.iter().all(|&used| used) {
        return;
    }
    let stays = |at: usize| !voxels.contains(&at) || is_used[at - voxels.start];
    let mut next = voxels.start as u32;
    let numbers: Vec<u32> = (voxels.start..mesh.vertices.len())
        .map(|at| {
            let number = next;
            next += u32::from(stays(at));
            number
        })
        .collect();
    for &at in marked {
        mesh.triangles[at] =
            mesh.triangles[at].map(|id| match (id as usize).checked_sub(voxels.start) {
                Some(behind) => numbers[behind],
                None => id,
            });
    }
    let mut at = 0..;
    mesh.vertices.retain(|_| at.next().is_some_and(stays));
    let mut at = 0..;
    mesh.normals.retain(|_| at.next().is_some_and(stays));
}

/// Where the gradient vanishes (a plateau at the iso value), the triangles determine the normals.
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
