//! `ppa xray simulate`: one radiograph of a posed limb.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::{Args, ValueEnum};
use ppa_ct::write_nifti;
use ppa_generate::{Case, ExposableLimb, Plan, Table, spectrum};
use ppa_scene::Contact;
use ppa_xray::TubeLoad;
use serde::Serialize;

use super::BeamArgs;
use super::follow::AnalogArgs;
use super::pictures::PictureArgs;
use super::report::Report;
use crate::commands::technique::TechniqueArgs;
use crate::findings::prepared;
use crate::interrupt::{NOTHING_WRITTEN, ends_at_once};
use crate::output::{Output, Stopwatch, bar, working};
use crate::output_files::ReplaceArgs;

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(super) enum EngineName {
    /// Ray-traced primary, Monte Carlo scatter, added quantum noise
    Fast,
    /// Analog Monte Carlo, no variance reduction
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
    technique: TechniqueArgs,
    #[command(flatten)]
    beam: BeamArgs,
    /// Engine
    #[arg(long, value_enum, default_value = "fast")]
    engine: EngineName,
    /// Histories: followed (analog) or whose noise the image carries (fast) [default: 2e7 or 2e10]
    #[arg(long)]
    histories: Option<f64>,
    /// Tube load in mAs, in place of histories
    #[arg(long, conflicts_with = "histories")]
    mas: Option<f64>,
    /// Automatic exposure control: tube load that gives this exposure index
    #[arg(long, value_name = "EI", conflicts_with_all = ["histories", "mas"])]
    aec: Option<f64>,
    /// Seed of histories and noise
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Radiograph to write: 16-bit PNG; may be left out if something else is written
    #[arg(long, required_unless_present_any = ["tally", "exr", "dicom", "dose_map"])]
    out: Option<PathBuf>,
    /// Tallies to write: OpenEXR with one layer per category
    #[arg(long)]
    exr: Option<PathBuf>,
    #[command(flatten)]
    pictures: PictureArgs,
    #[command(flatten)]
    analog: AnalogArgs,
    #[command(flatten)]
    replace: ReplaceArgs,
}

#[derive(Debug, Serialize)]
struct Simulated {
    #[serde(flatten)]
    report: Report,
    contact: Contact,
}

pub fn run(args: &SimulateArgs, output: Output) -> anyhow::Result<()> {
    if matches!(args.engine, EngineName::Fast)
        && let Some(option) = args.analog.given()
    {
        anyhow::bail!("{option} needs --engine analog");
    }
    // A resumed run replaces the images of the one before.
    let mut outputs = args.replace.or(args.analog.goes_on()).outputs();
    outputs.optional("--out", args.out.as_ref(), &[".png"])?;
    outputs.optional("--exr", args.exr.as_ref(), &[".exr"])?;
    args.pictures.declare(&mut outputs)?;
    let images = [&args.out, &args.exr, &args.pictures.dicom];
    let image = images.into_iter().flatten().next().map(PathBuf::as_path);
    let destination = match args.engine {
        EngineName::Fast => None,
        EngineName::Analog => Some(args.analog.declare(&mut outputs, image, args.replace)?),
    };
    let mut plan = match &args.plan {
        Some(path) => Plan::read(path)?,
        None => Plan::new(Vec::new()),
    };
    args.technique.apply(&mut plan.xray);
    args.beam.apply(&mut plan.xray);
    plan.xray.analog = None; // --engine decides.
    let given = args.mas.map(TubeLoad::Mas);
    let given = given.or(args.aec.map(TubeLoad::ExposureIndex));
    if let Some(load) = &given {
        anyhow::ensure!(
            matches!(args.engine, EngineName::Fast),
            "--mas and --aec need --engine fast: analog histories are followed one by one"
        );
        load.check()?;
    }
    plan.xray.tube_load = given.or(plan.xray.tube_load);
    if let (EngineName::Fast, Some(histories)) = (args.engine, args.histories) {
        plan.xray.engine.dose_histories = histories;
        plan.xray.tube_load = None;
    }
    let case = Case::read(&args.case)?;
    let working = working("preparing the limb");
    let prepared = prepared(&case, &args.case)?;
    let table = Arc::new(Table::of_plan(&plan)?);
    let spectrum = Arc::new(spectrum(&plan.xray)?);
    let limb = ExposableLimb::new(prepared, &plan, table, spectrum)?;
    let exposure = limb.pose(args.angle.to_radians())?;

    working.set_message("following photons");
    let watch = Stopwatch::start();
    let (radiograph, dose) = match &destination {
        None => {
            let _stoppable = ends_at_once(NOTHING_WRITTEN)?;
            working.finish_and_clear();
            let bar = bar("simulating");
            bar.set_length(100);
            let settings = exposure.fast_settings(plan.xray.engine.with_seed(args.seed))?;
            let observe = |share: f64| {
                bar.set_position((100.0 * share) as u64);
                ControlFlow::Continue(())
            };
            let (phantom, projection) = (&limb.phantom, &exposure.projection);
            let radiograph =
                phantom.fast_with_progress(&limb.spectrum, projection, &settings, &observe)?;
            bar.finish_and_clear();
            (radiograph, None)
        }
        Some(destination) => {
            working.finish_and_clear();
            let (histories, seed) = (args.histories, args.seed);
            let tally = args
                .analog
                .follow(&exposure, histories, seed, destination)?;
            (tally.radiograph(), tally.dose())
        }
    };
    let seconds = watch.read();
    let mut written: Vec<&Path> = args.analog.tally.iter().map(PathBuf::as_path).collect();
    let presentation = args.pictures.presentation(&plan.xray, &radiograph)?;
    if let Some(out) = &args.out {
        radiograph.write_png(out, &presentation)?;
        written.push(out);
    }
    args.pictures
        .write_dicom(&radiograph, presentation, &exposure, &case, args.angle)?;
    written.extend(args.pictures.dicom.as_deref());
    if let Some(exr) = &args.exr {
        radiograph.write_exr(exr)?;
        written.push(exr);
    }
    if let (Some(path), Some(dose)) = (&args.analog.dose_map, &dose) {
        write_nifti(path, &dose.map_ugy_per_mas(limb.phantom.phantom().grid())?)?;
        written.push(path);
    }
    working.finish_and_clear();
    let index = radiograph.exposure_index(&exposure.projection.receptor)?;
    let result = Simulated {
        report: Report::new(&radiograph, dose.as_ref(), seconds)
            .with_exposure_index(index, args.pictures.target_exposure_index(&plan.xray)),
        contact: exposure.placement.contact,
    };
    output.print(&result, |result| result.report.describe(&written))
}
