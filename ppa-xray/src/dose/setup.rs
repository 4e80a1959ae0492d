//! Regions of a dose tally (names, masses, geometry), and conversion of the sums to doses.

use serde::{Deserialize, Serialize};

use crate::dose::air_kerma::entrance_gy_per_history;
use crate::dose::report::{Dose, Estimate, Imparted, VoxelDose, mean};
use crate::dose::settings::{DoseError, DoseSettings, VoxelBox};
use crate::dose::tally::{DoseTally, Sum};
use crate::matter::energy_transfer::GRAY_PER_KEV_G;
use crate::phantom::voxels::voxel_mm3;
use crate::transport::tracking::Transport;

/// Data that do not depend on the histories: names, masses, geometry.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct DoseSetup {
    phantom_g: f64,
    materials: Vec<(String, f64)>,
    regions: Vec<(VoxelBox, f64)>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    labels: Vec<(u8, f64)>,
    voxels: Option<VoxelBox>,
    /// Masses of the voxels; kept apart from the numbers that are written as text.
    #[serde(skip)]
    pub voxel_g: Vec<f32>,
    entrance_air_kerma_gy_per_history: Option<f64>,
    detector_cm2: f64,
}

impl DoseSetup {
    /// # Errors
    /// [`DoseError`] for a box that extends beyond the phantom.
    pub fn new(transport: &Transport, settings: &DoseSettings) -> Result<Self, DoseError> {
        let phantom = &transport.tables.phantom;
        let grid = phantom.grid();
        settings.validate(grid)?;
        let volume_cm3 = voxel_mm3(grid) / 1e3;
        let grams = |voxel: usize| f64::from(phantom.density_g_cm3()[voxel]) * volume_cm3;
        let mut materials: Vec<(String, f64)> = phantom
            .materials()
            .iter()
            .map(|material| (material.name().to_owned(), 0.0))
            .collect();
        for (voxel, &material) in phantom.material().iter().enumerate() {
            materials[usize::from(material)].1 += grams(voxel);
        }
        let labels = settings.labels.as_ref().map_or_else(Vec::new, |labels| {
            let mut masses = [0.0; 256];
            for (voxel, &label) in labels.0.iter().enumerate() {
                masses[usize::from(label)] += grams(voxel);
            }
            let found = labels.found().into_iter();
            found
                .map(|label| (label, masses[usize::from(label)]))
                .collect()
        });
        let inside = |region: VoxelBox| -> Vec<f64> {
            let voxels = region.voxels();
            voxels.map(|voxel| grams(grid.index(voxel))).collect()
        };
        let detector = &transport.projection.detector;
        Ok(Self {
            phantom_g: materials.iter().map(|(_, mass_g)| mass_g).sum(),
            materials,
            regions: settings
                .regions
                .iter()
                .map(|region| (*region, inside(*region).iter().sum()))
                .collect(),
            labels,
            voxels: settings.voxels,
            voxel_g: settings
                .voxels
                .iter()
                .flat_map(|voxels| inside(*voxels))
                .map(|mass_g| mass_g as f32)
                .collect(),
            entrance_air_kerma_gy_per_history: entrance_gy_per_history(transport),
            detector_cm2: detector.pixel_cm2() * detector.pixels() as f64,
        })
    }

    /// An empty tally.
    pub fn tally(&self) -> DoseTally {
        DoseTally::new(
            self.materials.len(),
            self.regions.len(),
            self.labels.len(),
            self.voxels,
        )
    }

    /// The counted labels, in their order.
    pub fn labels(&self) -> Vec<u8> {
        self.labels.iter().map(|(label, _)| *label).collect()
    }

    pub fn regions(&self) -> Vec<VoxelBox> {
        self.regions.iter().map(|(region, _)| *region).collect()
    }

    /// Bytes of masses and sums in a file, or `None` if they overflow or a box is invalid.
    pub fn byte_len(&self) -> Option<u64> {
        let possible = |voxels: &VoxelBox| {
            let ordered = (0..3).all(|axis| voxels.low[axis] < voxels.high[axis]);
            if ordered { voxels.count() } else { None }
        };
        for (region, _) in &self.regions {
            possible(region)?;
        }
        let voxels = match &self.voxels {
            Some(voxels) => possible(voxels)? as u64,
            None => 0,
        };
        let few = 32 * (2 + self.materials.len() + self.regions.len() + self.labels.len()) as u64;
        voxels.checked_mul(4 + 16)?.checked_add(few)
    }

    /// Number of voxels that are counted one by one.
    pub fn voxel_count(&self) -> usize {
        self.voxels.and_then(|voxels| voxels.count()).unwrap_or(0)
    }

    /// Converts the sums of `histories` to doses.
    pub fn report(
        &self,
        tally: &DoseTally,
        histories: u64,
        histories_per_mas: Option<f64>,
    ) -> Dose {
        let sums = tally.sums();
        let imparted = |mass_g: f64, sum: &Sum| Imparted {
            mass_g,
            ev_per_history: Estimate::of(*sum, histories).scaled(1e3),
        };
        let voxels = self.voxels.map(|voxels| {
            let (ev_per_history, ev_per_history_se) = tally
                .voxel_sums()
                .iter()
                .map(|&[steps, squares]| {
                    let Estimate { value, se } = mean(steps as f64, squares as f64, histories);
                    ((1e3 * value) as f32, (1e3 * se) as f32)
                })
                .unzip();
            VoxelDose {
                voxels,
                mass_g: self.voxel_g.clone(),
                ev_per_history,
                ev_per_history_se,
            }
        });
        Dose {
            histories,
            histories_per_mas,
            phantom: imparted(self.phantom_g, &sums.phantom),
            materials: self
                .materials
                .iter()
                .zip(&sums.materials)
                .map(|((name, mass_g), sum)| (name.clone(), imparted(*mass_g, sum)))
                .collect(),
            regions: self
                .regions
                .iter()
                .zip(&sums.regions)
                .map(|((region, mass_g), sum)| (*region, imparted(*mass_g, sum)))
                .collect(),
            labels: self
                .labels
                .iter()
                .zip(&sums.labels)
                .map(|((label, mass_g), sum)| (*label, imparted(*mass_g, sum)))
                .collect(),
            voxels,
            entrance_air_kerma_gy_per_history: self.entrance_air_kerma_gy_per_history,
            detector_air_kerma_gy_per_history: Estimate::of(sums.detector_kerma, histories)
                .scaled(GRAY_PER_KEV_G / self.detector_cm2),
        }
    }
}
