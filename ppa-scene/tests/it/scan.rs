//! A phantom's limb alone in its scan.

use std::sync::LazyLock;

use nalgebra::{Affine3, Matrix4, Point3, Rotation3, Translation3, Vector3};
use ppa_ct::{Grid, Interpolation, Volume};
use ppa_mesh::{Border, Mesh, iso_surface};
use ppa_phantom::{LowerLeg, TableTop};
use ppa_scene::{LandmarkError, LandmarkOverrides, Landmarks, Side, find_landmarks};

/// A limb alone in its scan: everything above −500 HU.
pub struct Scan {
    pub volume: Volume,
    pub skin: Mesh,
    pub mask: Vec<bool>,
}

impl Scan {
    pub fn of(volume: Volume) -> Self {
        let skin = iso_surface(&volume, -500.0, Border::Open).unwrap();
        let mask = volume.hu().iter().map(|hu| *hu >= -500.0).collect();
        Self { volume, skin, mask }
    }

    pub fn find(
        &self,
        side: Side,
        overrides: &LandmarkOverrides,
    ) -> Result<Landmarks, LandmarkError> {
        find_landmarks(&self.volume, &self.skin, &self.mask, side, overrides)
    }

    /// A limb rotated in the world while the scanner's slices stay level; `points` are on its skin.
    pub fn under_the_scanner<'a>(
        volume: &Volume,
        points: impl Iterator<Item = &'a Point3<f64>>,
        turn: &Rotation3<f64>,
    ) -> Self {
        let spacing_mm = volume.grid().spacing_mm().min();
        let mut low = Point3::from(Vector3::repeat(f64::INFINITY));
        let mut high = -low;
        for p in points {
            let p = turn * p;
            (low, high) = (low.inf(&p), high.sup(&p));
        }
        let origin = low - Vector3::repeat(5.0 * spacing_mm);
        let size = (high - low).map(|d| (d / spacing_mm).ceil() as usize + 10);
        let level = Translation3::from(origin.coords).to_homogeneous()
            * Matrix4::new_nonuniform_scaling(&Vector3::repeat(spacing_mm));
        let grid = |matrix| Grid::new(size.into(), Affine3::from_matrix_unchecked(matrix)).unwrap();
        let in_the_limb = grid(turn.inverse().to_homogeneous() * level);
        let sampled = volume
            .resampled_to(&in_the_limb, Interpolation::Linear, -1000.0)
            .unwrap();
        Self::of(Volume::new(grid(level), sampled.hu().to_vec()).unwrap())
    }

    /// The same voxels in a rotated world.
    pub fn turned(&self, turn: &Rotation3<f64>) -> Self {
        let grid = self.volume.grid();
        let affine = turn.to_homogeneous() * grid.ct_from_voxel().matrix();
        let grid = Grid::new(grid.size(), Affine3::from_matrix_unchecked(affine)).unwrap();
        Self::of(Volume::new(grid, self.volume.hu().to_vec()).unwrap())
    }

    /// Slices `range` of the scan, counted from distal.
    pub fn slices(&self, range: std::ops::Range<usize>) -> Self {
        let [ni, nj, _] = self.volume.grid().size();
        Self::of(
            self.volume
                .crop([0, 0, range.start], [ni, nj, range.end])
                .unwrap(),
        )
    }
}

pub static P01: LazyLock<Scan> =
    LazyLock::new(|| Scan::of(LowerLeg::p01().voxelise(2.0, TableTop::Absent).unwrap()));
