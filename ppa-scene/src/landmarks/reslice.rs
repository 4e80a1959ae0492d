//! Slices across a limb that is oblique in its scan.

use nalgebra::{Affine3, Matrix3, Matrix4, Point3, Vector3};
use ppa_ct::{Grid, Interpolation, Volume, VolumeError};

use crate::room::plane::across;

/// A limb in slices across a direction: the third axis of its grid.
pub(crate) struct Resliced {
    pub(crate) volume: Volume,
    pub(crate) mask: Vec<bool>,
    /// Slices at the proximal end that the end of the scan cuts obliquely.
    pub(crate) cut: Vec<bool>,
}

/// Air, for places outside the scan.
const OUTSIDE_HU: f32 = -1000.0;

/// Voxels finer than this add nothing about a tibia, mm.
const FINEST_MM: f64 = 1.0;

impl Resliced {
    /// Cubic voxels as large as the scan's smallest side, but at least [`FINEST_MM`].
    pub(crate) fn across(
        volume: &Volume,
        mask: &[bool],
        direction: &Vector3<f64>,
    ) -> Result<Self, VolumeError> {
        let source = volume.grid();
        let spacing_mm = source.spacing_mm().min().max(FINEST_MM);
        let (e1, e2) = across(direction);
        let ct_from_slices = Matrix3::from_columns(&[e1, e2, *direction]);
        let mut low = Vector3::repeat(f64::INFINITY);
        let mut high = -low;
        for index in (0..mask.len()).filter(|index| mask[*index]) {
            let centre = source.centre(source.voxel(index).map(|v| v as f64));
            let at = ct_from_slices.tr_mul(&centre.coords);
            (low, high) = (low.inf(&at), high.sup(&at));
        }
        let size = (high - low).map(|length| (length / spacing_mm).ceil() as usize + 3);
        let origin = ct_from_slices * (low - Vector3::repeat(spacing_mm));
        let mut matrix = Matrix4::identity();
        matrix
            .fixed_view_mut::<3, 3>(0, 0)
            .copy_from(&(ct_from_slices * spacing_mm));
        matrix.fixed_view_mut::<3, 1>(0, 3).copy_from(&origin);
        let grid = Grid::new(size.into(), Affine3::from_matrix_unchecked(matrix))?;
        let volume = volume.resampled_to(&grid, Interpolation::Linear, OUTSIDE_HU)?;

        let voxel_from_slices = source.voxel_from_ct() * grid.ct_from_voxel();
        let mut areas = vec![0_usize; size.z];
        let nearest = |index: usize| {
            let at = voxel_from_slices * Point3::from(grid.voxel(index).map(|v| v as f64));
            let at: [f64; 3] = at.coords.map(f64::round).into();
            let fits = (0..3).all(|axis| (0.0..source.size()[axis] as f64).contains(&at[axis]));
            let voxel = at.map(|v| v as usize);
            let inside = fits && mask[source.index(voxel)];
            areas[grid.voxel(index)[2]] += usize::from(inside);
            inside
        };
        let mask = (0..grid.len()).map(nearest).collect();
        let whole = proximal_whole(&areas, spacing_mm);
        let cut = (0..size.z).map(|slice| slice > whole).collect();
        Ok(Self { volume, mask, cut })
    }
}

/// The most proximal slice that shows the whole limb: nine tenths of the largest section that
/// follows within 60 mm, the span of an oblique cut through a calf.
fn proximal_whole(areas: &[usize], spacing_mm: f64) -> usize {
    let window = (60.0 / spacing_mm) as usize;
    let is_whole = |slice: &usize| {
        let most = areas[slice.saturating_sub(window)..=*slice].iter().max();
        10 * areas[*slice] >= 9 * most.copied().unwrap_or(0) && areas[*slice] > 0
    };
    (0..areas.len()).rev().find(is_whole).unwrap_or(0)
}
