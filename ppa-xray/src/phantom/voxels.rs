//! The patient as seen by the photons: one material and one density per voxel.

use nalgebra::Point3;
use ppa_ct::{Grid, Volume};
use rayon::prelude::*;

use crate::matter::form_factors::FormFactors;
use crate::matter::material::Material;
use crate::phantom::calibration_error::CalibrationError;
use crate::phantom::hu::HuCalibration;
use crate::phantom::interpolation::Interpolation;
use crate::phantom::segmentation::Segmentation;

/// Why a voxel phantom is not valid.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PhantomError {
    /// Number of values and number of voxels differ.
    #[error("{found} {what} for {expected} voxels")]
    Length {
        /// Name of the values.
        what: &'static str,
        /// Number of values given.
        found: usize,
        /// Number of voxels of the grid.
        expected: usize,
    },
    /// There is no material, or there are more than an 8-bit index can address.
    #[error("{0} materials; a phantom holds 1 to 256")]
    MaterialCount(usize),
    /// A voxel refers to a material that does not exist.
    #[error("voxel ({}, {}, {}) has material index {found}, but the number of materials is {materials}", voxel[0], voxel[1], voxel[2])]
    MaterialIndex {
        /// The voxel (i, j, k).
        voxel: [usize; 3],
        /// Material index of the voxel.
        found: u8,
        /// Number of materials.
        materials: usize,
    },
    /// A density is NaN, negative or infinite.
    #[error("voxel ({}, {}, {}) has a density of {found} g/cm³, expected zero or more", voxel[0], voxel[1], voxel[2])]
    Density {
        /// The voxel (i, j, k).
        voxel: [usize; 3],
        /// Density of the voxel.
        found: f32,
    },
    /// The mask contains no voxels.
    #[error("the mask contains none of the scan's voxels")]
    EmptyMask,
    /// The HU calibration is invalid.
    #[error(transparent)]
    Calibration(#[from] CalibrationError),
}

/// Checks that the mask has one flag per voxel and that at least one is set.
pub(super) fn check_mask(mask: Option<&[bool]>, voxels: usize) -> Result<(), PhantomError> {
    match mask {
        Some(mask) if mask.len() != voxels => Err(PhantomError::Length {
            what: "mask values",
            found: mask.len(),
            expected: voxels,
        }),
        _ => Ok(()),
    }
}

/// Volume of a voxel, mm³; voxels may be sheared.
pub(crate) fn voxel_mm3(grid: &Grid) -> f64 {
    let ct_from_voxel = grid.ct_from_voxel().matrix().fixed_view::<3, 3>(0, 0);
    ct_from_voxel.determinant().abs()
}

/// Materials and densities on the lattice of a CT; vacuum outside it.
///
/// [`Interpolation`] determines the density between the centres of voxels. Memory order is that of [`Grid::index`], i fastest.
#[derive(Debug, Clone)]
pub struct VoxelPhantom {
    grid: Grid,
    material: Vec<u8>,
    density_g_cm3: Vec<f32>,
    materials: Vec<Material>,
    interpolation: Interpolation,
}

impl VoxelPhantom {
    /// Builds a phantom of homogeneous voxels from one material index and one density in g/cm³ each.
    ///
    /// # Errors
    /// [`PhantomError`] naming the invalid voxel or count.
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
            interpolation: Interpolation::Nearest,
        })
    }

    /// The same voxels with another interpolation of the density between their centres.
    #[must_use]
    pub fn with_interpolation(self, interpolation: Interpolation) -> Self {
        Self {
            interpolation,
            ..self
        }
    }

    /// The same voxels with Rayleigh scattering by other form factors, see [`Material::with_form_factors`].
    #[must_use]
    pub fn with_form_factors(mut self, form_factors: FormFactors) -> Self {
        let materials = self.materials.into_iter();
        self.materials = materials
            .map(|material| material.with_form_factors(form_factors))
            .collect();
        self
    }

    /// Builds a phantom from Hounsfield units, trilinear between the centres of voxels. Voxels outside `mask` (one flag per voxel)
    /// get the material of the lowest HU, air. [`HuCalibration::audit`] lists the resulting materials.
    ///
    /// # Errors
    /// [`PhantomError`] if the calibration is invalid or the mask has the wrong length.
    pub fn from_volume(
        volume: &Volume,
        calibration: &HuCalibration,
        mask: Option<&[bool]>,
    ) -> Result<Self, PhantomError> {
        let segmentation = Segmentation::new(calibration)?;
        let hu = volume.values();
        check_mask(mask, hu.len())?;
        let voxel = |index: usize| {
            let kept = mask.is_none_or(|mask| mask[index]);
            segmentation.voxel(if kept {
                hu.at(index)
            } else {
                f32::NEG_INFINITY
            })
        };
        // Only materials in use are kept, since each costs sampling tables.
        let none = || vec![false; segmentation.materials().len()];
        let occurs = (0..hu.len())
            .into_par_iter()
            .fold(none, |mut occurs, index| {
                occurs[voxel(index).material] = true;
                occurs
            })
            .reduce(none, |a, b| a.iter().zip(b).map(|(a, b)| a | b).collect());
        let (kept, materials): (Vec<usize>, Vec<Material>) = segmentation
            .materials()
            .iter()
            .enumerate()
            .filter(|(material, _)| occurs[*material])
            .map(|(material, made)| (material, made.clone()))
            .unzip();
        if !(1..=256).contains(&materials.len()) {
            return Err(PhantomError::MaterialCount(materials.len()));
        }
        let mut renumbered = vec![0; occurs.len()];
        for (new, old) in kept.into_iter().enumerate() {
            renumbered[old] = new as u8;
        }
        let (material, density) = (0..hu.len())
            .into_par_iter()
            .map(|index| {
                let voxel = voxel(index);
                (renumbered[voxel.material], voxel.density_g_cm3)
            })
            .unzip();
        let phantom = Self::new(volume.grid().clone(), material, density, materials)?;
        Ok(phantom.with_interpolation(Interpolation::Trilinear))
    }

    /// The lattice, in the `ct` frame.
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// Interpolation of the density between the centres of voxels.
    pub fn interpolation(&self) -> Interpolation {
        self.interpolation
    }

    /// Index into [`VoxelPhantom::materials`] of every voxel.
    pub fn material(&self) -> &[u8] {
        &self.material
    }

    /// Mass density of every voxel, g/cm³.
    pub fn density_g_cm3(&self) -> &[f32] {
        &self.density_g_cm3
    }

    /// The materials in use.
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
