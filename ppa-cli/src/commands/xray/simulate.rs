//! `ppa xray simulate`: one radiograph of a posed limb.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::{Args, ValueEnum};
use ppa_cluster::HistoryCost;
use ppa_core::Part;
use ppa_ct::write_nifti;
use ppa_generate::{Case, ExposableLimb, Plan, Table, spectrum};
use ppa_scene::Contact;
use ppa_xray::{Stop, TubeLoad};
use serde::Serialize;

use super::BeamArgs;
use super::divisible::{Divisible, MEASURE};
use super::follow::{AnalogArgs, TallyDestination};
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
    /// Take room, positioning and x-ray settings from this plan
    #[arg(long)]
    plan: Option<PathBuf>,
    #[command(flatten)]
    technique: TechniqueArgs,
    #[command(flatten)]
    beam: BeamArgs,
    /// Engine
    #[arg(long, value_enum, default_value = "fast")]
    engine: EngineName,
    /// Histories: to follow (analog), or whose noise the image has (fast) [default: 2e7 or 2e10]
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

impl SimulateArgs {
    /// Declares all outputs, and chooses where the histories of the analog engine are kept.
    fn declare(&self) -> anyhow::Result<Option<TallyDestination>> {
        if matches!(self.engine, EngineName::Fast)
            && let Some(option) = self.analog.given()
        {
            anyhow::bail!("{option} needs --engine analog");
        }
        // A resumed run replaces the images of the previous one.
        let mut outputs = self.replace.or(self.analog.goes_on()).outputs();
        outputs.optional("--out", self.out.as_ref(), &[".png"])?;
        outputs.optional("--exr", self.exr.as_ref(), &[".exr"])?;
        self.pictures.declare(&mut outputs)?;
        let images = [&self.out, &self.exr, &self.pictures.dicom];
        let image = images.into_iter().flatten().next().map(PathBuf::as_path);
        Ok(match self.engine {
            EngineName::Fast => None,
            EngineName::Analog => Some(self.analog.declare(&mut outputs, image, self.replace)?),
        })
    }

    /// The plan with the changes of the command line.
    fn plan(&self) -> anyhow::Result<Plan> {
        let mut plan = match &self.plan {
            Some(path) => Plan::read(path)?,
            None => Plan::new(Vec::new()),
        };
        self.technique.apply(&mut plan.xray);
        self.beam.apply(&mut plan.xray);
        plan.xray.analog = None; // --engine decides.
        let given = self.mas.map(TubeLoad::Mas);
        let given = given.or(self.aec.map(TubeLoad::ExposureIndex));
        if let Some(load) = &given {
            anyhow::ensure!(
                matches!(self.engine, EngineName::Fast),
                "--mas and --aec need --engine fast: analog histories are followed one by one"
            );
            load.check()?;
        }
        plan.xray.tube_load = given.or(plan.xray.tube_load);
        if let (EngineName::Fast, Some(histories)) = (self.engine, self.histories) {
            plan.xray.engine.dose_histories = histories;
            plan.xray.tube_load = None;
        }
        Ok(plan)
    }

    fn limb(&self, case: &Case, plan: &Plan) -> anyhow::Result<ExposableLimb> {
        let prepared = prepared(case, &self.case)?;
        let table = Arc::new(Table::of_plan(plan)?);
        let spectrum = Arc::new(spectrum(&plan.xray)?);
        Ok(ExposableLimb::new(prepared, plan, table, spectrum)?)
    }

    /// The histories of this command, for division into tasks.
    pub fn divisible(&self) -> anyhow::Result<Divisible> {
        anyhow::ensure!(
            matches!(self.engine, EngineName::Analog),
            "only analog histories can be divided into tasks: give --engine analog"
        );
        self.analog.check_divisible()?;
        self.plan()?;
        Case::read(&self.case)?;
        Ok(Divisible {
            input: self.case.clone(),
            histories: self.analog.histories(self.histories)?,
            projections: 1,
        })
    }

    /// Refuses outputs that could not be written at the end.
    pub fn check_outputs(&self) -> anyhow::Result<()> {
        self.declare().map(|_| ())
    }

    /// Processor time per history, measured on some.
    pub fn cost(&self) -> anyhow::Result<HistoryCost> {
        let watch = Stopwatch::start();
        let limb = self.limb(&Case::read(&self.case)?, &self.plan()?)?;
        let exposure = limb.pose(self.angle.to_radians())?;
        let histories = self.analog.histories(self.histories)?;
        let run = self.analog.run(&exposure, histories, self.seed)?;
        let mut tally = run.tally(Part::WHOLE);
        let preparation_cpu_s = watch.read().cpu_s;
        let stop = Stop {
            time: Some(MEASURE),
            ..Stop::default()
        };
        run.follow(&mut tally, &stop, |_, _| ControlFlow::Continue(()))?;
        let follow_cpu_s = watch.read().cpu_s - preparation_cpu_s;
        Ok(HistoryCost {
            million_cpu_s: follow_cpu_s * 1e6 / tally.done().end as f64,
            preparation_cpu_s,
        })
    }
}

pub fn run(args: &SimulateArgs, output: Output) -> anyhow::Result<()> {
    let destination = args.declare()?;
    let plan = args.plan()?;
    let case = Case::read(&args.case)?;
    let working = working("preparing the limb");
    let limb = args.limb(&case, &plan)?;
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
    let kerma =
        (limb.phantom).entrance_air_kerma_gy_per_history(&limb.spectrum, &exposure.projection)?;
    let index = radiograph.exposure_index(&exposure.projection.receptor)?;
    let result = Simulated {
        report: Report::new(&radiograph, dose.as_ref(), seconds)
            .with_entrance_kerma(&radiograph, kerma)
            .with_exposure_index(index, args.pictures.target_exposure_index(&plan.xray)),
        contact: exposure.placement.contact,
    };
    output.print(&result, |result| result.report.describe(&written))
}
