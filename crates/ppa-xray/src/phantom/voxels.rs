//! The patient as the photons see it: one material and one density per voxel.

use nalgebra::Point3;
use ppa_ct::{Grid, Volume};

use crate::matter::material::Material;
use crate::matter::material_error::MaterialError;
use crate::phantom::graded_bone::GradedBone;
use crate::phantom::hu::{CalibrationError, HuCalibration, Tissue};

/// Why a voxel phantom cannot be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PhantomError {
    /// Number of values and number of voxels differ.
    #[error("{found} {what} for {expected} voxels")]
    Length {
        /// Which values.
        what: &'static str,
        /// Values given.
        found: usize,
        /// Voxels of the grid.
        expected: usize,
    },
    /// No material, or more than an 8-bit index can name.
    #[error("{0} materials; a phantom holds 1 to 256")]
    MaterialCount(usize),
    /// A voxel names a material that does not exist.
    #[error("voxel {voxel:?} names material {found}, but there are {materials}")]
    MaterialIndex {
        /// The voxel (i, j, k).
        voxel: [usize; 3],
        /// Its material index.
        found: u8,
        /// Number of materials.
        materials: usize,
    },
    /// A density is NaN, negative or infinite.
    #[error("voxel {voxel:?} has a density of {found} g/cm³")]
    Density {
        /// The voxel (i, j, k).
        voxel: [usize; 3],
        /// Its density.
        found: f32,
    },
    /// The HU calibration makes no sense.
    #[error(transparent)]
    Calibration(#[from] CalibrationError),
    /// A material of the calibration cannot be made.
    #[error(transparent)]
    Material(#[from] MaterialError),
}

/// Materials and densities on the lattice of a CT; vacuum outside it.
///
/// Every voxel is homogeneous. Memory order is that of [`Grid::index`], i fastest.
#[derive(Debug, Clone)]
pub struct VoxelPhantom {
    grid: Grid,
    material: Vec<u8>,
    density_g_cm3: Vec<f32>,
    materials: Vec<Material>,
}

impl VoxelPhantom {
    /// A phantom from one material index and one density in g/cm³ per voxel.
    ///
    /// # Errors
    /// [`PhantomError`] naming the voxel or the count at fault.
    pub fn new(
        grid: Grid,
        material: Vec<u8>,
        density_g_cm3: Vec<f32>,
        materials: Vec<Material>,
    ) -> Result<Self, PhantomError> {
        let expected = grid.len();
        for (what, found) in [
            ("material indices", material.len()),
            ("densities", density_g_cm3.len()),
        ] {
            if found != expected {
                return Err(PhantomError::Length {
                    what,
                    found,
                    expected,
                });
            }
        }
        if !(1..=256).contains(&materials.len()) {
            return Err(PhantomError::MaterialCount(materials.len()));
        }
        if let Some(bad) = material
            .iter()
            .position(|&m| usize::from(m) >= materials.len())
        {
            return Err(PhantomError::MaterialIndex {
                voxel: grid.voxel(bad),
                found: material[bad],
                materials: materials.len(),
            });
        }
        if let Some(bad) = density_g_cm3
            .iter()
            .position(|d| !(d.is_finite() && *d >= 0.0))
        {
            return Err(PhantomError::Density {
                voxel: grid.voxel(bad),
                found: density_g_cm3[bad],
            });
        }
        Ok(Self {
            grid,
            material,
            density_g_cm3,
            materials,
        })
    }

    /// A phantom from Hounsfield units; voxels outside `mask` (one flag per voxel) become air.
    ///
    /// # Errors
    /// [`PhantomError`] when the calibration is not usable or the mask has the wrong length.
    pub fn from_volume(
        volume: &Volume,
        calibration: &HuCalibration,
        mask: Option<&[bool]>,
    ) -> Result<Self, PhantomError> {
        calibration.validate()?;
        let hu = volume.hu();
        if let Some(mask) = mask.filter(|mask| mask.len() != hu.len()) {
            return Err(PhantomError::Length {
                what: "mask values",
                found: mask.len(),
                expected: hu.len(),
            });
        }
        let mut materials = ["air", "titanium", "soft_tissue"]
            .into_iter()
            .map(Material::named)
            .collect::<Result<Vec<_>, _>>()?;
        let bone = GradedBone::new(calibration)?;
        let first_bone = materials.len() as u8;
        materials.extend(bone.materials(&materials[2])?);
        let kept = |voxel: usize| mask.is_none_or(|mask| mask[voxel]);
        let (material, density) = hu
            .iter()
            .enumerate()
            .map(|(voxel, &hu)| {
                let hu = if kept(voxel) { hu } else { f32::NEG_INFINITY };
                let density_g_cm3 = calibration.density_g_cm3(hu);
                let index = match calibration.tissue(hu) {
                    Tissue::Air => 0,
                    Tissue::Titanium => 1,
                    Tissue::SoftTissue => 2,
                    Tissue::Bone => first_bone + bone.level(density_g_cm3) as u8,
                };
                (index, density_g_cm3)
            })
            .unzip();
        Self::new(volume.grid().clone(), material, density, materials)
    }

    /// The lattice, in the `ct` frame.
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// Index into [`VoxelPhantom::materials`] of every voxel.
    pub fn material(&self) -> &[u8] {
        &self.material
    }

    /// Mass density of every voxel, g/cm³.
    pub fn density_g_cm3(&self) -> &[f32] {
        &self.density_g_cm3
    }

    /// The materials that occur.
    pub fn materials(&self) -> &[Material] {
        &self.materials
    }

    /// The eight corners of the voxel box in the `ct` frame, mm: half a voxel beyond the centres.
    pub fn corners_ct(&self) -> [Point3<f64>; 8] {
        let size = self.grid.size();
        std::array::from_fn(|corner| {
            self.grid.centre(std::array::from_fn(|axis| {
                if corner >> axis & 1 == 1 {
                    size[axis] as f64 - 0.5
                } else {
                    -0.5
                }
            }))
        })
    }
}
