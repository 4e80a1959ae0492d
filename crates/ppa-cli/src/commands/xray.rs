//! `ppa xray`: radiographs, spectra and materials.

use std::path::PathBuf;

use anyhow::Context;
use clap::{Args, Subcommand, ValueEnum};
use ppa_dataset::{
    Case, Plan, PreparedLimb, Table, XraySettings, joint_phantom, projection, spectrum,
};
use ppa_scene::{Contact, place};
use ppa_xray::{AnalogSettings, CategorySums, Engine, FastSettings, Material, analog, fast};
use serde::Serialize;

use crate::output::{Output, Seconds, Stopwatch, working};

#[derive(Debug, Subcommand)]
pub enum XrayCommand {
    /// One radiograph of a posed limb
    Simulate(SimulateArgs),
    /// The beam of a tungsten tube behind filters
    Spectrum(SpectrumArgs),
    /// Mass attenuation of a material
    Materials(MaterialsArgs),
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

#[derive(Debug, Clone, Copy, ValueEnum)]
enum EngineName {
    /// Ray-traced primary, Monte Carlo scatter, added quantum noise
    Fast,
    /// Every history as nature plays it
    Analog,
}

#[derive(Debug, Args)]
pub struct SimulateArgs {
    /// Case written by `ppa prepare`
    case: PathBuf,
    /// Medial rotation in degrees
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true)]
    angle: f64,
    /// Take room, device and x-ray settings from this plan
    #[arg(long)]
    plan: Option<PathBuf>,
    #[command(flatten)]
    beam: BeamArgs,
    /// Engine
    #[arg(long, value_enum, default_value = "fast")]
    engine: EngineName,
    /// Histories: followed (analog) or whose noise the image carries (fast) [default: 2e7 or 2e10]
    #[arg(long)]
    histories: Option<f64>,
    /// Seed of histories and noise
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Radiograph to write: 16-bit PNG
    #[arg(long)]
    out: PathBuf,
    /// Tallies to write: OpenEXR with one layer per category
    #[arg(long)]
    exr: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub struct SpectrumArgs {
    #[command(flatten)]
    beam: BeamArgs,
}

#[derive(Debug, Args)]
pub struct MaterialsArgs {
    /// A named material; without one, all names are listed
    #[arg(long, conflicts_with = "composition")]
    material: Option<String>,
    /// Mass fractions by element, as "Ca:0.4,C:0.12,O:0.48"
    #[arg(long)]
    composition: Option<String>,
    /// Density in g/cm³ of a composition
    #[arg(long, default_value_t = 1.0)]
    density: f64,
    /// Photon energy in keV
    #[arg(long, default_value_t = 60.0)]
    energy_kev: f64,
}

pub fn run(command: &XrayCommand, output: Output) -> anyhow::Result<()> {
    match command {
        XrayCommand::Simulate(args) => simulate(args, output),
        XrayCommand::Spectrum(args) => beam(args, output),
        XrayCommand::Materials(args) => materials(args, output),
    }
}

#[derive(Debug, Serialize)]
struct Simulated {
    projections: [CategorySums; 1],
    histories: f64,
    engine: Engine,
    contact: Contact,
    #[serde(flatten)]
    seconds: Seconds,
}

fn simulate(args: &SimulateArgs, output: Output) -> anyhow::Result<()> {
    let mut plan = match &args.plan {
        Some(path) => Plan::read(path)?,
        None => Plan::new(Vec::new()),
    };
    args.beam.apply(&mut plan.xray);
    let case = Case::read(&args.case)?;
    let working = working("preparing the limb");
    let prepared = PreparedLimb::of_case(&case)
        .with_context(|| format!("cannot prepare the limb of {}", args.case.display()))?;
    let table = Table::of_plan(&plan)?;
    let placement = place(
        &prepared.limb.mesh.vertices,
        &prepared.landmarks,
        args.angle.to_radians(),
        &table.plane.plane,
        &table.room.device,
    )?;
    let phantom = joint_phantom(&prepared, &plan.xray)?;
    let spectrum = spectrum(&plan.xray)?;
    let device = &table.room.device;
    let projection = projection(&placement, &prepared.landmarks, device, plan.xray.detector);

    working.set_message("following photons");
    let watch = Stopwatch::start();
    let radiograph = match args.engine {
        EngineName::Fast => {
            let settings = FastSettings {
                dose_histories: args.histories.unwrap_or(plan.xray.engine.dose_histories),
                seed: args.seed,
                ..plan.xray.engine
            };
            fast(&phantom, &spectrum, &projection, &settings)?
        }
        EngineName::Analog => {
            let histories = args.histories.unwrap_or(2e7);
            anyhow::ensure!(
                (1.0..=1e15).contains(&histories),
                "--histories is {histories}, expected 1 to 1e15 for the analog engine"
            );
            let settings = AnalogSettings {
                histories: histories as u64,
                seed: args.seed,
            };
            analog(&phantom, &spectrum, &projection, &settings)?
        }
    };
    let seconds = watch.read();
    radiograph.write_png(&args.out, &plan.xray.presentation)?;
    if let Some(exr) = &args.exr {
        radiograph.write_exr(exr)?;
    }
    working.finish_and_clear();
    let result = Simulated {
        projections: [radiograph.sums],
        histories: radiograph.histories,
        engine: radiograph.engine,
        contact: placement.contact,
        seconds,
    };
    output.print(&result, |result| {
        let sums = &result.projections[0];
        let line = |name: &str, value: f64, se: f64| format!("{name:<10}{value:>12.3} ± {se:.3}\n");
        let mut text = "eV per history on the detector\n".to_owned();
        for category in ppa_xray::Category::ALL {
            let (value, se) = sums.of(category);
            text += &line(category.name(), value, se);
        }
        text += &format!(
            "{:.3e} histories, {:.1} s, {:.1} CPU s; {}",
            result.histories,
            seconds.wall_s,
            seconds.cpu_s,
            args.out.display()
        );
        text
    })
}

#[derive(Debug, Serialize)]
struct Beam {
    mean_energy_kev: f64,
    hvl1_mm_al: f64,
    hvl2_mm_al: f64,
    fluence_per_mas_cm2_at_1m: Option<f64>,
    kerma_ugy_per_mas_at_1m: Option<f64>,
}

fn beam(args: &SpectrumArgs, output: Output) -> anyhow::Result<()> {
    let mut settings = XraySettings::default();
    args.beam.apply(&mut settings);
    let spectrum = spectrum(&settings)?;
    let beam = Beam {
        mean_energy_kev: spectrum.mean_energy_kev(),
        hvl1_mm_al: spectrum.hvl1_mm_al(),
        hvl2_mm_al: spectrum.hvl2_mm_al(),
        fluence_per_mas_cm2_at_1m: spectrum.fluence_per_mas_cm2_at_1m(),
        kerma_ugy_per_mas_at_1m: spectrum.kerma_ugy_per_mas_at_1m(),
    };
    output.print(&beam, |beam| {
        let mut text = format!(
            "mean energy {:.2} keV, HVL1 {:.3} mm Al, HVL2 {:.3} mm Al",
            beam.mean_energy_kev, beam.hvl1_mm_al, beam.hvl2_mm_al
        );
        if let (Some(fluence), Some(kerma)) =
            (beam.fluence_per_mas_cm2_at_1m, beam.kerma_ugy_per_mas_at_1m)
        {
            text += &format!("; at 1 m {fluence:.4e} photons/(mAs cm²), {kerma:.2} µGy/mAs");
        }
        text
    })
}

#[derive(Debug, Serialize)]
struct Attenuation {
    material: String,
    density_g_cm3: f64,
    energy_kev: f64,
    photoelectric_cm2_g: f64,
    rayleigh_cm2_g: f64,
    compton_cm2_g: f64,
    total_cm2_g: f64,
}

#[derive(Debug, Serialize)]
struct Known {
    materials: Vec<&'static str>,
}

fn materials(args: &MaterialsArgs, output: Output) -> anyhow::Result<()> {
    let material = match (&args.material, &args.composition) {
        (Some(name), _) => Material::named(name)?,
        (None, Some(text)) => Material::parse_composition("composition", args.density, text)?,
        (None, None) => {
            let known = Known {
                materials: Material::names().collect(),
            };
            return output.print(&known, |known| known.materials.join("\n"));
        }
    };
    let energy_kev = args.energy_kev;
    let attenuation = Attenuation {
        material: material.name().to_owned(),
        density_g_cm3: material.density_g_cm3(),
        energy_kev,
        photoelectric_cm2_g: material.photoelectric_cm2_g(energy_kev)?,
        rayleigh_cm2_g: material.rayleigh_cm2_g(energy_kev)?,
        compton_cm2_g: material.compton_cm2_g(energy_kev)?,
        total_cm2_g: material.total_cm2_g(energy_kev)?,
    };
    output.print(&attenuation, |a| {
        format!(
            "{} ({} g/cm³) at {} keV, cm²/g: photoelectric {:.5e}, Rayleigh {:.5e}, Compton {:.5e}, total {:.5e}",
            a.material,
            a.density_g_cm3,
            a.energy_kev,
            a.photoelectric_cm2_g,
            a.rayleigh_cm2_g,
            a.compton_cm2_g,
            a.total_cm2_g
        )
    })
}
