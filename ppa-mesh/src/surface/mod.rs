//! Iso-surface of a volume by marching cubes in parts of equal work.
//!
//! It takes 0.58 of the processor time of VTK 9's flying edges with normals (bench `mesh`, docs/performance.md), and has the
//! topology of the trilinear interpolant, which VTK's surface does not.

mod cell;
mod cells;
mod crossings;
mod extra;
mod field;
mod inside;
mod join;
mod march;
mod numbers;
mod points;
mod shortcut;
mod tunnel;
mod world;

use std::ops::Range;

use ppa_ct::{Grid, Values, Volume};
use rayon::prelude::*;

use crate::mesh::Mesh;
use field::{Field, Sample, padded};
use inside::InsideBits;
use join::join;
use march::{March, Part};
use world::World;

/// What happens where the body reaches the border of the volume.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Border {
    /// The surface ends there, with boundary edges.
    #[default]
    Open,
    /// Flat lids close it at the outer faces of the border voxels, half a voxel beyond their centres.
    Closed,
}

/// Why there is no surface.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SurfaceError {
    /// No crossing of the iso value.
    #[error("no surface at {iso_hu} HU: the volume's values lie between {min_hu} and {max_hu} HU")]
    Empty {
        /// Requested iso value.
        iso_hu: f32,
        /// Smallest value of the volume.
        min_hu: f32,
        /// Largest value of the volume.
        max_hu: f32,
    },
    /// The iso value is NaN or infinite.
    #[error("the iso value {0} HU is not a finite number")]
    Iso(f32),
    /// Surfaces need neighbouring voxels on every axis.
    #[error("a volume of {} x {} x {} voxels is too thin for a surface; expected at least two along each axis", .0[0], .0[1], .0[2])]
    TooThin([usize; 3]),
    /// Vertex indices have 30 bits.
    #[error("the surface has more than 2^30 vertices")]
    TooLarge,
}

/// The surface where the trilinear interpolant of `volume` equals `iso_hu`.
///
/// Inside is `value >= iso_hu`. One vertex per crossed lattice edge, linearly interpolated, in world
/// mm and shared by its triangles; where a voxel equals the iso value exactly, all its crossings are
/// one vertex and the triangles that would have no area are left out. Topology is that of the
/// trilinear interpolant (asymptotic decider on faces, exact connectivity inside cells). A cell whose
/// loop cannot be filled otherwise gets an extra vertex. Triangles are counter-clockwise and normals
/// point outward, towards lower HU; a normal is the HU gradient in world mm, so it holds for any
/// spacing, shear, and left-handed grids.
///
/// Vertices and triangles come in the same order for any number of threads.
///
/// # Errors
/// [`SurfaceError`] when nothing crosses the iso value or the volume is one voxel thin.
///
/// ```
/// use nalgebra::{Point3, Vector3};
/// use ppa_ct::{Grid, Volume};
/// use ppa_mesh::{Border, iso_surface};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let grid = Grid::axis_aligned([40; 3], Vector3::repeat(1.0), Point3::origin())?;
/// let centre = Point3::new(19.6, 19.3, 19.9);
/// let ball = (0..grid.len())
///     .map(|i| {
///         let p = grid.centre(grid.voxel(i).map(|v| v as f64));
///         (-500.0 - 100.0 * ((p - centre).norm() - 15.0)) as f32
///     })
///     .collect();
/// let skin = iso_surface(&Volume::new(grid, ball)?, -500.0, Border::Open)?;
/// assert_eq!(skin.boundary_edges(), 0);
/// assert!((skin.area_mm2() / (4.0 * std::f64::consts::PI * 225.0) - 1.0).abs() < 2e-3);
/// # Ok(())
/// # }
/// ```
pub fn iso_surface(volume: &Volume, iso_hu: f32, border: Border) -> Result<Mesh, SurfaceError> {
    let mut surfaces = iso_surfaces(volume, &[iso_hu], border)?;
    Ok(surfaces.swap_remove(0))
}

/// [`iso_surface`] for several iso values, in their order, in one pass over the volume.
///
/// # Errors
/// The same as [`iso_surface`]. Of several errors, the first in this order is returned: an iso value that
/// is not finite, a volume that is too thin, an iso value above the range of the samples, and the first
/// iso value whose surface is empty or too large.
pub fn iso_surfaces(
    volume: &Volume,
    iso_hu: &[f32],
    border: Border,
) -> Result<Vec<Mesh>, SurfaceError> {
    if let Some(&bad) = iso_hu.iter().find(|iso| !iso.is_finite()) {
        return Err(SurfaceError::Iso(bad));
    }
    let (grid, size) = (volume.grid(), volume.grid().size());
    match (border, volume.values()) {
        (Border::Open, Values::I16(hu)) => {
            let field = |&iso| Field::new(hu, size, [0.0; 3], iso);
            surfaces(&iso_hu.iter().map(field).collect::<Vec<_>>(), grid)
        }
        (Border::Open, Values::F32(hu)) => {
            let field = |&iso| Field::new(hu, size, [0.0; 3], iso);
            surfaces(&iso_hu.iter().map(field).collect::<Vec<_>>(), grid)
        }
        (Border::Closed, _) => {
            let padded: Vec<_> = iso_hu
                .iter()
                .map(|&iso| (iso, padded(volume, iso)))
                .collect();
            let size = size.map(|n| n + 2);
            let field = |(iso, hu)| Field::new(hu, size, [-1.0; 3], iso);
            let fields = padded.iter().map(|(iso, hu)| field((*iso, hu)));
            surfaces(&fields.collect::<Vec<_>>(), grid)
        }
    }
}

/// [`iso_surface`] of a box of `size` voxels from `low` on of a volume with that grid; normals at
/// the faces of the box are one-sided.
pub(crate) fn surface_of_part(
    grid: &Grid,
    low: [usize; 3],
    size: [usize; 3],
    hu: &[f32],
    iso_hu: f32,
) -> Result<Mesh, SurfaceError> {
    let origin = low.map(|first| first as f64);
    let mut surfaces = surfaces(&[Field::new(hu, size, origin, iso_hu)], grid)?;
    Ok(surfaces.swap_remove(0))
}

/// The surfaces of fields with the same size and origin.
fn surfaces<T: Sample>(fields: &[Field<T>], grid: &Grid) -> Result<Vec<Mesh>, SurfaceError> {
    let Some(field) = fields.first() else {
        return Ok(Vec::new());
    };
    if field.size().iter().any(|&n| n < 2) {
        return Err(SurfaceError::TooThin(field.size()));
    }
    let first_inside: Vec<T> = fields
        .iter()
        .map(|field| T::first_inside(field.iso()).ok_or_else(|| empty(field)))
        .collect::<Result<_, _>>()?;
    let world = World::new(grid, field.origin());
    // One part per thread: the first is extended in place, the others are copied behind it. The result does not
    // depend on the parts.
    let crossings = estimated_crossings(fields, &first_inside);
    // Comparing a voxel takes about as long as 1/256 of a crossing with its triangles.
    let compared = field.size()[0] * field.size()[1] * fields.len() / 256;
    let work: Vec<usize> = crossings.iter().map(|here| here + compared).collect();
    let layers = layers_of_parts(&work, rayon::current_num_threads());
    let by_part: Vec<Vec<Part>> = (layers.into_par_iter())
        .map(|layers| {
            let room = match layers.start {
                0 => crossings.iter().sum(),
                _ => crossings[layers.clone()].iter().sum(),
            };
            march(fields, &first_inside, &world, layers, room)
        })
        .collect();
    let mut by_field: Vec<Vec<Part>> = fields.iter().map(|_| Vec::new()).collect();
    for part in by_part {
        for (of_field, part) in by_field.iter_mut().zip(part) {
            of_field.push(part);
        }
    }
    let joined = by_field.into_iter().zip(fields).map(|(parts, field)| {
        let mesh = join(parts, world.mirrored)?;
        match mesh.triangles.is_empty() {
            true => Err(empty(field)),
            false => Ok(mesh),
        }
    });
    joined.collect()
}

/// The surfaces of all fields within the layers of cells between slices k and k + 1 for k in `layers`.
fn march<T: Sample>(
    fields: &[Field<T>],
    first_inside: &[T],
    world: &World,
    layers: Range<usize>,
    room: usize,
) -> Vec<Part> {
    let slices = fields[0].size()[2];
    let mut marches: Vec<_> = (fields.iter().zip(first_inside))
        .map(|(field, &first_inside)| {
            let first_slice = layers.start.saturating_sub(1);
            let mut inside = InsideBits::new(field, first_inside, first_slice);
            inside.extend_to((layers.start + 2).min(slices), field);
            let march = March::new(field, &inside, world, layers.start, room / fields.len());
            (inside, march)
        })
        .collect();
    for k in layers.clone() {
        // The slice on top belongs to the next part, if there is one.
        let own = k + 1 < layers.end || k + 2 == slices;
        for (inside, march) in &mut marches {
            // Compared shortly before its samples are needed again, while they are in the cache.
            inside.extend_to((k + 3).min(slices), march.field);
            march.layer(inside, k, own);
        }
    }
    marches.into_iter().map(|(_, march)| march.part).collect()
}

/// Estimated number of edges that cross the iso values from each slice on, from every eighth slice, plus a
/// quarter; for sharing work and reserving memory.
fn estimated_crossings<T: Sample>(fields: &[Field<T>], first_inside: &[T]) -> Vec<usize> {
    const STRIDE: usize = 8;
    let slices = fields[0].size()[2];
    let sampled: Vec<usize> = (0..slices.div_ceil(STRIDE))
        .into_par_iter()
        .map(|at| {
            let each = fields
                .iter()
                .zip(first_inside)
                .map(|(field, &first_inside)| {
                    let mut inside = InsideBits::new(field, first_inside, STRIDE * at);
                    inside.extend_to(STRIDE * at + 1, field);
                    inside.crossings(STRIDE * at)
                });
            each.sum()
        })
        .collect();
    // Of three directions, two lie in a slice.
    (0..slices).map(|k| sampled[k / STRIDE] * 15 / 8).collect()
}

/// Divides the layers of cells between slices into parts with as equal work as whole layers allow.
fn layers_of_parts(work: &[usize], parts: usize) -> Vec<Range<usize>> {
    let layers = work.len() - 1;
    let all: usize = work[..layers].iter().sum();
    let mut ranges = Vec::new();
    let (mut start, mut done) = (0, 0);
    for (k, here) in work[..layers].iter().enumerate() {
        done += here;
        let is_full = ranges.len() + 1 < parts && done * parts >= all * (ranges.len() + 1);
        if is_full || k + 1 == layers {
            ranges.push(start..k + 1);
            start = k + 1;
        }
    }
    ranges
}

fn empty<T: Sample>(field: &Field<T>) -> SurfaceError {
    let [min_hu, max_hu] = field.range();
    SurfaceError::Empty {
        iso_hu: field.iso(),
        min_hu,
        max_hu,
    }
}
