//! `ppa xray simulate`: one radiograph of a posed limb.

use std::path::PathBuf;

use anyhow::Context;
use clap::{Args, ValueEnum};
use ppa_dataset::{Case, Plan, PreparedLimb, Table, joint_phantom, projection, spectrum};
use ppa_scene::{Contact, place};
use ppa_xray::{AnalogSettings, CategorySums, Engine, FastSettings, analog, fast};
use serde::Serialize;

use super::BeamArgs;
use crate::output::{Output, Seconds, Stopwatch, working};

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(super) enum EngineName {
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

#[derive(Debug, Serialize)]
struct Simulated {
    projections: [CategorySums; 1],
    histories: f64,
    engine: Engine,
    contact: Contact,
    #[serde(flatten)]
    seconds: Seconds,
}

pub fn run(args: &SimulateArgs, output: Output) -> anyhow::Result<()> {
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
    let projection = projection(&placement, &prepared.landmarks, device, &plan.xray);

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
                ..AnalogSettings::default()
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
