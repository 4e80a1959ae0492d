//! Doses with their standard errors.

use serde::{Deserialize, Serialize};

use crate::dose::settings::VoxelBox;
use crate::dose::tally::{STEPS_PER_KEV, STEPS_PER_KEV2, Sum};
use crate::matter::energy_transfer::GRAY_PER_KEV_G;

/// A mean and its standard error.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Estimate {
    /// The mean.
    pub value: f64,
    /// Standard error of the mean.
    pub se: f64,
}

/// Energy imparted to some matter.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Imparted {
    /// Mass of the matter, g.
    pub mass_g: f64,
    /// Energy, eV per history.
    pub ev_per_history: Estimate,
}

/// Energy imparted to the phantom by the histories of one exposure, and air kerma.
///
/// All values are per history; multiply by [`Dose::histories_per_mas`] for values per mAs. Electrons deposit their energy where
/// they are set free, so kerma equals dose in voxels larger than their range (0.3 mm of water at 150 keV).
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Dose {
    /// Histories counted.
    pub histories: u64,
    /// Photons emitted into the field per mAs, if the spectrum knows its fluence.
    pub histories_per_mas: Option<f64>,
    /// The whole phantom.
    pub phantom: Imparted,
    /// By material, with its name, in the order of the phantom.
    pub materials: Vec<(String, Imparted)>,
    /// Requested regions, in their order.
    pub regions: Vec<(VoxelBox, Imparted)>,
    /// Requested labels, in ascending order.
    pub labels: Vec<(u8, Imparted)>,
    /// Requested voxels.
    pub voxels: Option<VoxelDose>,
    /// Air kerma free in air (without backscatter) where the central ray enters the patient, Gy per history: at the first
    /// voxel denser than 0.3 g/cm³. `None` if the central ray meets no such voxel.
    pub entrance_air_kerma_gy_per_history: Option<f64>,
    /// Air kerma of all photons that cross the detector, averaged over its area, Gy per history. Photons at less than 6° to
    /// the plane count as at 3°.
    pub detector_air_kerma_gy_per_history: Estimate,
}

/// Dose in a box of voxels, first axis fastest.
#[derive(Debug, Clone, PartialEq)]
pub struct VoxelDose {
    /// The box of voxels.
    pub voxels: VoxelBox,
    /// Mass of each voxel, g.
    pub mass_g: Vec<f32>,
    /// Energy imparted to each voxel, eV per history.
    pub ev_per_history: Vec<f32>,
    /// Standard error of the energy imparted to each voxel, eV per history.
    pub ev_per_history_se: Vec<f32>,
}

impl Imparted {
    /// Absorbed dose, Gy per history; zero where there is no mass.
    pub fn gy_per_history(&self) -> Estimate {
        self.ev_per_history.scaled(gray_per_ev(self.mass_g))
    }
}

impl VoxelDose {
    /// Absorbed dose of each voxel, Gy per history; zero where there is no mass.
    pub fn gy_per_history(&self) -> Vec<f32> {
        gray(&self.ev_per_history, &self.mass_g)
    }
}

impl Estimate {
    /// Converts `sum` over `histories` to keV per history.
    pub(crate) fn of(sum: Sum, histories: u64) -> Self {
        mean(sum.value as f64, sum.square as f64, histories)
    }

    pub(crate) fn scaled(self, factor: f64) -> Self {
        Self {
            value: self.value * factor,
            se: self.se * factor,
        }
    }
}

/// Mean energy in keV per history with its standard error, from sums in steps.
pub(crate) fn mean(steps: f64, square_steps: f64, histories: u64) -> Estimate {
    let n = histories as f64;
    let value = steps / STEPS_PER_KEV / n;
    let variance = (square_steps / STEPS_PER_KEV2 / n - value * value).max(0.0);
    Estimate {
        value,
        se: (variance / n).sqrt(),
    }
}

fn gray_per_ev(mass_g: f64) -> f64 {
    if mass_g > 0.0 {
        1e-3 * GRAY_PER_KEV_G / mass_g
    } else {
        0.0
    }
}

fn gray(ev: &[f32], mass_g: &[f32]) -> Vec<f32> {
    ev.iter()
        .zip(mass_g)
        .map(|(&ev, &mass)| (f64::from(ev) * gray_per_ev(f64::from(mass))) as f32)
        .collect()
}
