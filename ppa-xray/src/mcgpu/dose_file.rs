//! Doses of an entire scan, and the files that MC-GPU writes them to.

use std::fmt::Write;
use std::path::Path;

use crate::dose::report::{Dose, Estimate, Imparted};
use crate::dose::settings::{DoseSettings, VoxelBox};
use crate::image::output::write_whole;
use crate::matter::material::Material;
use crate::mcgpu::error::McgpuError;
use crate::mcgpu::simulation::Simulation;

/// Why a dose cannot be added to those of a scan.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ScanDoseError {
    /// The sums belong to another simulation.
    #[error(
        "the sums hold {} listed materials and {} voxels, but the simulation has {} and {}",
        found[0], found[1], expected[0], expected[1]
    )]
    Sums {
        /// Numbers of listed materials and voxels in the sums.
        found: [usize; 2],
        /// Numbers of listed materials and voxels in the simulation.
        expected: [usize; 2],
    },
    /// The dose is for the materials of another phantom.
    #[error(
        "the dose is for the materials {found}, but the voxels of the simulation have {expected}"
    )]
    Materials {
        /// Names of the dose's materials.
        found: String,
        /// Names of the phantom's materials.
        expected: String,
    },
    /// The dose is for other voxels than the input file requests.
    #[error(
        "the dose is for {}, but the input file requests {}",
        described(found),
        described(expected)
    )]
    Voxels {
        /// Voxels of the dose.
        found: Option<VoxelBox>,
        /// Voxels requested.
        expected: Option<VoxelBox>,
    },
}

fn described(voxels: &Option<VoxelBox>) -> String {
    voxels.as_ref().map_or_else(
        || "no voxels".to_owned(),
        |VoxelBox { low, high }| format!("the voxels {low:?} to {high:?}"),
    )
}

/// Energy imparted by all projections of a scan, per history of all of them.
#[derive(Debug, Clone, PartialEq)]
pub struct ScanDose {
    histories: u64,
    /// Sums by line of the material list.
    materials: Vec<Sum>,
    materials_mass_g: Vec<f64>,
    voxels: Vec<Sum>,
}

/// Energy of all histories, eV, and its squared standard error.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Sum {
    ev: f64,
    se_ev2: f64,
}

impl Sum {
    fn add(&mut self, ev: f64, se_ev: f64, histories: f64) {
        self.ev += ev * histories;
        self.se_ev2 += (se_ev * histories).powi(2);
    }

    fn per_history(&self, histories: f64) -> Estimate {
        Estimate {
            value: self.ev / histories,
            se: self.se_ev2.sqrt() / histories,
        }
    }
}

impl Simulation {
    /// The doses that the input file requests; `None` if there are none.
    pub fn dose_settings(&self) -> Option<DoseSettings> {
        let voxels = self.dose_box();
        (self.input().material_dose || voxels.is_some()).then(|| DoseSettings {
            voxels,
            ..DoseSettings::default()
        })
    }

    /// The voxels whose dose is requested, clipped at the border of the geometry as in MC-GPU.
    pub(crate) fn dose_box(&self) -> Option<VoxelBox> {
        let size = self.phantom().grid().size();
        self.input().voxel_dose.as_ref().map(|dose| VoxelBox {
            low: dose.first,
            high: [0, 1, 2].map(|axis| (dose.last[axis] + 1).min(size[axis])),
        })
    }
}

/// Numbers of materials and voxels whose doses are summed.
fn sizes(simulation: &Simulation) -> [usize; 2] {
    let voxels = simulation.dose_box();
    let voxels = voxels.map_or(0, |voxels| voxels.size().iter().product());
    [simulation.input().materials.len(), voxels]
}

impl ScanDose {
    /// Empty sums.
    pub fn new(simulation: &Simulation) -> Self {
        let [listed, voxels] = sizes(simulation);
        Self {
            histories: 0,
            materials: vec![Sum::default(); listed],
            materials_mass_g: vec![0.0; listed],
            voxels: vec![Sum::default(); voxels],
        }
    }

    /// Adds the dose of one projection.
    ///
    /// # Errors
    /// [`ScanDoseError`] if `dose` was not counted with [`Simulation::dose_settings`] of the same simulation, or if these sums
    /// belong to another one; the sums are then unchanged.
    pub fn add(&mut self, simulation: &Simulation, dose: &Dose) -> Result<(), ScanDoseError> {
        self.check(simulation, dose)?;
        let histories = dose.histories as f64;
        self.histories += dose.histories;
        for (&listed, (_, imparted)) in simulation.listed().iter().zip(&dose.materials) {
            let listed = usize::from(listed);
            let Estimate { value, se } = imparted.ev_per_history;
            self.materials[listed].add(value, se, histories);
            self.materials_mass_g[listed] = imparted.mass_g;
        }
        if let Some(dose) = &dose.voxels {
            let estimates = dose.ev_per_history.iter().zip(&dose.ev_per_history_se);
            for (sum, (&ev, &se)) in self.voxels.iter_mut().zip(estimates) {
                sum.add(f64::from(ev), f64::from(se), histories);
            }
        }
        Ok(())
    }

    /// Checks that the dose has the materials and voxels of the simulation.
    fn check(&self, simulation: &Simulation, dose: &Dose) -> Result<(), ScanDoseError> {
        let (found, expected) = ([self.materials.len(), self.voxels.len()], sizes(simulation));
        if found != expected {
            return Err(ScanDoseError::Sums { found, expected });
        }
        let found: Vec<&str> = dose.materials.iter().map(|(name, _)| &**name).collect();
        let materials = simulation.phantom().materials().iter();
        let expected: Vec<&str> = materials.map(Material::name).collect();
        if found != expected {
            return Err(ScanDoseError::Materials {
                found: found.join(", "),
                expected: expected.join(", "),
            });
        }
        let (found, expected) = (
            dose.voxels.as_ref().map(|dose| dose.voxels),
            simulation.dose_box(),
        );
        if found != expected {
            return Err(ScanDoseError::Voxels { found, expected });
        }
        Ok(())
    }

    /// Histories of all projections.
    pub fn histories(&self) -> u64 {
        self.histories
    }

    /// Energy and mass by line of the material list; zero for materials without voxels.
    pub fn materials(&self) -> Vec<Imparted> {
        let masses = self.materials_mass_g.iter();
        masses
            .zip(&self.materials)
            .map(|(&mass_g, sum)| Imparted {
                mass_g,
                ev_per_history: sum.per_history(self.histories as f64),
            })
            .collect()
    }

    /// Writes the voxel doses into `folder`, if the input file requests them, under the name given there: the
    /// plane at the height of the source as text; all voxels as 32-bit floats in eV/g per history, with `.raw` appended to
    /// the name; and twice their relative standard errors in percent, with `_PercentRelError2sigma.raw` appended. x runs fastest.
    ///
    /// MC-GPU divides by the histories of all projections, including those outside the angles of interest; these doses are
    /// per history followed.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self, folder: &Path, simulation: &Simulation) -> Result<(), McgpuError> {
        for (name, bytes) in self.files(simulation) {
            write_whole(&folder.join(name), &bytes)?;
        }
        Ok(())
    }

    /// Names and contents of the files that [`Self::write`] writes.
    pub(crate) fn files(&self, simulation: &Simulation) -> Vec<(String, Vec<u8>)> {
        let (Some(asked), Some(voxels)) = (&simulation.input().voxel_dose, simulation.dose_box())
        else {
            return Vec::new();
        };
        let grid = simulation.phantom().grid();
        let densities = simulation.phantom().density_g_cm3();
        let voxel_cm3 = grid.spacing_mm().product() / 1_000.0;
        let doses: Vec<Estimate> = voxels
            .voxels()
            .zip(&self.voxels)
            .map(|(voxel, sum)| {
                let mass_g = f64::from(densities[grid.index(voxel)]) * voxel_cm3;
                sum.per_history(self.histories as f64).scaled(1.0 / mass_g)
            })
            .collect();
        let floats = |of: fn(&Estimate) -> f64| -> Vec<u8> {
            let values = doses.iter().map(|dose| of(dose) as f32);
            values.flat_map(f32::to_le_bytes).collect()
        };
        let relative = |dose: &Estimate| {
            if dose.value > 0.0 {
                200.0 * dose.se / dose.value
            } else {
                0.0
            }
        };
        let name = &asked.file;
        let text = self.text(simulation, &voxels, &doses).into_bytes();
        vec![
            (name.clone(), text),
            (format!("{name}.raw"), floats(|dose| dose.value)),
            (
                format!("{name}_PercentRelError2sigma.raw"),
                floats(relative),
            ),
        ]
    }

    /// Serialises all sums, little-endian: histories (u64), then f64.
    pub(crate) fn to_bytes(&self) -> Vec<u8> {
        let sums = self.materials.iter().chain(&self.voxels);
        let sums = sums.flat_map(|sum| [sum.ev, sum.se_ev2]);
        let numbers = self.materials_mass_g.iter().copied().chain(sums);
        let histories = self.histories.to_le_bytes();
        histories
            .into_iter()
            .chain(numbers.flat_map(f64::to_le_bytes))
            .collect()
    }

    /// Reads the doses of a scan of `simulation` from [`Self::to_bytes`]; `None` if the number of bytes does not match.
    pub(crate) fn from_bytes(simulation: &Simulation, bytes: &[u8]) -> Option<Self> {
        let mut dose = Self::new(simulation);
        let (histories, numbers) = bytes.split_first_chunk()?;
        dose.histories = u64::from_le_bytes(*histories);
        let sums = dose.materials.iter_mut().chain(&mut dose.voxels);
        let sums = sums.flat_map(|sum| [&mut sum.ev, &mut sum.se_ev2]);
        let (numbers, rest) = numbers.as_chunks();
        let mut numbers = numbers.iter();
        for number in dose.materials_mass_g.iter_mut().chain(sums) {
            *number = f64::from_le_bytes(*numbers.next()?);
        }
        (numbers.len() == 0 && rest.is_empty()).then_some(dose)
    }

    fn text(&self, simulation: &Simulation, voxels: &VoxelBox, doses: &[Estimate]) -> String {
        let grid = simulation.phantom().grid();
        let side_cm = grid.spacing_mm() / 10.0;
        let [columns, rows, planes] = voxels.size();
        let height = simulation.input().source_cm.z / side_cm.z + 1e-5;
        let within = (voxels.low[2] as f64..voxels.high[2] as f64).contains(&height);
        let plane = if within {
            height as usize
        } else {
            (voxels.low[2] + voxels.high[2] - 1) / 2
        };
        let bounds = |axis: usize| format!("[{},{}]", voxels.low[axis] + 1, voxels.high[axis]);
        let mut text = format!(
            "# \n#  Dose in the layout of MC-GPU v1.3, by the analog engine of ppa-xray\n#\n\
             #  Energy imparted by photons to each voxel; electrons deposit where they are born.\n\
             #  All voxels are in the .raw file (32-bit floats); here is the plane at the level\n\
             #  of the source focal spot: z_coord = {plane} (z_coord in ROI = {})\n#\n\
             #  Voxel size:  {:.6} x {:.6} x {:.6} = {:.6} cm^3\n\
             #  Number of voxels in the reported region of interest (ROI) X, Y and Z:\n\
             #      {columns}  {rows}  {planes}\n\
             #  Coordinates of the ROI inside the voxel volume = X{}, Y{}, Z{}\n#\n\
             #  Voxel dose units: eV/g per history\n\
             #  X rows given first, then Y. One blank line separates the different Y.\n# \n\
             #    [DOSE]   [2*standard_deviation]\n# =====================================\n",
            plane - voxels.low[2],
            side_cm.x,
            side_cm.y,
            side_cm.z,
            side_cm.product(),
            bounds(0),
            bounds(1),
            bounds(2),
        );
        let first = (plane - voxels.low[2]) * columns * rows;
        for row in doses[first..first + columns * rows].chunks(columns) {
            for dose in row {
                writeln!(text, "{:.6} {:.6}", dose.value, 2.0 * dose.se)
                    .expect("strings take everything");
            }
            text.push('\n');
        }
        let ev: f64 = self.voxels.iter().map(|sum| sum.ev).sum();
        let kev = 1e-3 * ev / self.histories as f64;
        text + &format!(
            "\n#   ****** DOSE REPORT ******\n\
             #       Total number of simulated x rays: {}\n\
             \n#       Total energy absorved inside the dose ROI: {kev:.5} keV/hist\n\n",
            self.histories,
        )
    }
}
