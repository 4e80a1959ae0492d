//! Iso-surface of a volume by marching cubes over slabs of slices.

mod cell;
mod cell_row;
mod crossings;
mod extra;
mod field;
mod inside;
mod shortcut;
mod slab;
mod tunnel;
mod world;

use nalgebra::Vector3;
use ppa_ct::{Grid, Values, Volume};
use rayon::prelude::*;

use crate::mesh::Mesh;
use field::{Field, Sample, padded};
use slab::{NEXT_SLAB, Slab};
use world::World;

/// Slices of cells per unit of parallel work; fixed, so that the vertex order never depends on the
/// number of threads.
const SLAB_CELLS: usize = 16;

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
        /// Iso value asked for.
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
    #[error("a volume of {0:?} voxels is too thin for a surface; every side needs at least two")]
    TooThin([usize; 3]),
    /// Vertex indices have 31 bits.
    #[error("the surface has more than 2^31 vertices")]
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
/// As [`iso_surface`]. Of several reasons the first in this order is told: an iso value that is no
/// number, a volume too thin, an iso value above all that its samples can hold, and of the others the first
/// iso value that has no surface or too large a one.
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

/// The surfaces of fields of one size and origin.
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
    let layers = field.size()[2] - 1;
    let by_slab: Vec<Vec<Slab>> = (0..layers.div_ceil(SLAB_CELLS))
        .into_par_iter()
        .map(|slab| {
            let first = slab * SLAB_CELLS;
            let layers = first..(first + SLAB_CELLS).min(layers);
            let each = fields.iter().zip(&first_inside);
            each.map(|(field, &inside)| slab::march(field, &world, inside, layers.clone()))
                .collect()
        })
        .collect();
    let mut slabs: Vec<Vec<Slab>> = fields.iter().map(|_| Vec::new()).collect();
    for slab in by_slab {
        for (of_field, slab) in slabs.iter_mut().zip(slab) {
            of_field.push(slab);
        }
    }
    let meshes = slabs.into_iter().zip(fields);
    meshes
        .map(|(slabs, field)| {
            let mesh = join(&slabs)?;
            if mesh.triangles.is_empty() {
                return Err(empty(field));
            }
            Ok(mesh)
        })
        .collect()
}

fn empty<T: Sample>(field: &Field<T>) -> SurfaceError {
    let [min_hu, max_hu] = field.range();
    SurfaceError::Empty {
        iso_hu: field.iso(),
        min_hu,
        max_hu,
    }
}

fn join(slabs: &[Slab]) -> Result<Mesh, SurfaceError> {
    let mut offsets = vec![0_usize];
    for slab in slabs {
        offsets.push(offsets[offsets.len() - 1] + slab.vertices.len());
    }
    if offsets[slabs.len()] >= NEXT_SLAB as usize {
        return Err(SurfaceError::TooLarge);
    }
    let vertices_and_normals = || {
        let mut joined = (
            Vec::with_capacity(offsets[slabs.len()]),
            Vec::with_capacity(offsets[slabs.len()]),
        );
        for slab in slabs {
            joined.0.extend_from_slice(&slab.vertices);
            joined.1.extend_from_slice(&slab.normals);
        }
        joined
    };
    let triangles = || {
        let mut joined = Vec::with_capacity(slabs.iter().map(|slab| slab.triangles.len()).sum());
        for (at, slab) in slabs.iter().enumerate() {
            let (own, next) = (offsets[at] as u32, offsets[at + 1] as u32);
            joined.extend(slab.triangles.iter().map(|triangle| {
                triangle.map(|id| match id & NEXT_SLAB {
                    0 => own + id,
                    _ => next + (id & !NEXT_SLAB),
                })
            }));
        }
        joined
    };
    let ((vertices, normals), triangles) = rayon::join(vertices_and_normals, triangles);
    let mut mesh = Mesh {
        vertices,
        normals,
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
