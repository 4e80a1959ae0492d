//! Iso-surface of a volume by marching cubes over slabs of slices.

mod cell;
mod extra;
mod field;
mod slab;
mod tunnel;

use nalgebra::{Matrix3, Point3, Vector3};
use ppa_ct::{Grid, Values, Volume};
use rayon::prelude::*;

use crate::mesh::Mesh;
use field::{Field, padded};
use slab::{NEXT_SLAB, Slab};

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
/// use ppa_ct::{Grid, Values, Volume};
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
    if !iso_hu.is_finite() {
        return Err(SurfaceError::Iso(iso_hu));
    }
    let (grid, size) = (volume.grid(), volume.grid().size());
    match border {
        Border::Open => surface(&Field::new(volume.values(), size, [0.0; 3], iso_hu), grid),
        Border::Closed => {
            let hu = padded(volume, iso_hu);
            let hu = Values::F32(&hu);
            surface(
                &Field::new(hu, size.map(|n| n + 2), [-1.0; 3], iso_hu),
                grid,
            )
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
    surface(&Field::new(Values::F32(hu), size, origin, iso_hu), grid)
}

fn surface(field: &Field, grid: &Grid) -> Result<Mesh, SurfaceError> {
    if field.size().iter().any(|&n| n < 2) {
        return Err(SurfaceError::TooThin(grid.size()));
    }
    let layers = field.size()[2] - 1;
    let slabs: Vec<Slab> = (0..layers.div_ceil(SLAB_CELLS))
        .into_par_iter()
        .map(|slab| {
            let first = slab * SLAB_CELLS;
            slab::march(field, first..(first + SLAB_CELLS).min(layers))
        })
        .collect();
    let mesh = join(&slabs, grid, field)?;
    if mesh.triangles.is_empty() {
        let [min_hu, max_hu] = field.range();
        return Err(SurfaceError::Empty {
            iso_hu: field.iso(),
            min_hu,
            max_hu,
        });
    }
    Ok(mesh)
}

fn join(slabs: &[Slab], grid: &Grid, field: &Field) -> Result<Mesh, SurfaceError> {
    let mut offsets = vec![0_usize];
    for slab in slabs {
        offsets.push(offsets[offsets.len() - 1] + slab.positions.len());
    }
    let count = offsets[slabs.len()];
    if count >= NEXT_SLAB as usize {
        return Err(SurfaceError::TooLarge);
    }
    let affine = grid.ct_from_voxel();
    let linear: Matrix3<f64> = affine.matrix().fixed_view::<3, 3>(0, 0).into_owned();
    let left_handed = linear.determinant() < 0.0;
    // A gradient is a covector: it maps with the inverse transpose. Outward is down the gradient.
    let outward = -linear.try_inverse().unwrap_or_default().transpose();

    let (vertices, normals): (Vec<_>, Vec<_>) = slabs
        .par_iter()
        .flat_map_iter(|slab| slab.positions.iter().zip(&slab.gradients))
        .map(|(voxel, gradient)| {
            let point = affine * Point3::from(*voxel + field.origin());
            let normal = (outward * gradient).try_normalize(0.0).unwrap_or_default();
            (point.cast::<f32>(), normal.cast::<f32>())
        })
        .unzip();
    let triangles = slabs
        .par_iter()
        .enumerate()
        .flat_map_iter(|(at, slab)| {
            let (own, next) = (offsets[at] as u32, offsets[at + 1] as u32);
            slab.triangles.iter().map(move |triangle| {
                let [a, b, c] = triangle.map(|id| match id & NEXT_SLAB {
                    0 => own + id,
                    _ => next + (id & !NEXT_SLAB),
                });
                if left_handed { [a, c, b] } else { [a, b, c] }
            })
        })
        .collect();
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
