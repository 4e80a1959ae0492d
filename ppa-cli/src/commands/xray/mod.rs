//! `ppa xray`: radiographs, spectra and materials.

mod audit;
mod divisible;
mod follow;
mod materials;
mod mcgpu;
mod mcgpu_part;
mod merge;
mod pictures;
mod report;
mod simulate;
mod spectrum;

pub use divisible::Divisible;
pub use mcgpu::McgpuArgs;
pub use simulate::SimulateArgs;

use clap::{Args, Subcommand};
use ppa_generate::XraySettings;

use crate::output::Output;

#[derive(Debug, Subcommand)]
pub enum XrayCommand {
    /// One radiograph of a posed limb
    Simulate(Box<simulate::SimulateArgs>),
    /// One radiograph from the tallies of all parts of an analog run
    Merge(merge::MergeArgs),
    /// The beam of a tungsten tube behind filters
    Spectrum(spectrum::SpectrumArgs),
    /// Mass attenuation of a material
    Materials(materials::MaterialsArgs),
    /// Materials, volumes, masses and clipped voxels after HU calibration
    ///
    /// Takes a CT, or a case (.toml) for its limb alone.
    Audit(audit::AuditArgs),
    /// Run an input file of MC-GPU v1.3
    Mcgpu(mcgpu::McgpuArgs),
}

#[derive(Debug, Args)]
pub struct BeamArgs {
    /// Tube voltage in kV [default: 60]
    #[arg(long)]
    kvp: Option<f64>,
    /// Filter as MATERIAL:mm, in place of 2.5 mm Al; repeat for a stack
    #[arg(long = "filter", value_name = "MATERIAL:MM")]
    filters: Vec<String>,
    /// Angle of the anode in degrees [default: 12]
    #[arg(long)]
    anode_angle: Option<f64>,
}

impl BeamArgs {
    fn apply(&self, settings: &mut XraySettings) {
        settings.kvp = self.kvp.unwrap_or(settings.kvp);
        settings.anode_angle_deg = self.anode_angle.unwrap_or(settings.anode_angle_deg);
        if !self.filters.is_empty() {
            settings.filters.clone_from(&self.filters);
        }
    }
}

pub fn run(command: &XrayCommand, output: Output) -> anyhow::Result<()> {
    match command {
        XrayCommand::Simulate(args) => simulate::run(args, output),
        XrayCommand::Merge(args) => merge::run(args, output),
        XrayCommand::Spectrum(args) => spectrum::run(args, output),
        XrayCommand::Materials(args) => materials::run(args, output),
        XrayCommand::Audit(args) => audit::run(args, output),
        XrayCommand::Mcgpu(args) => mcgpu::run(args, output),
    }
}
