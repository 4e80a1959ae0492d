//! `ppa plan`: estimated cost of a plan.

use std::path::{Path, PathBuf};

use anyhow::bail;
use clap::{Args, Subcommand};
use ppa_cluster::{ClusterSize, Makespan, PoseCost, bundle, makespan, shell_quoted};
use ppa_core::text::count;
use ppa_generate::{Forecast, Plan, forecast};
use serde::Serialize;

use super::generate::dataset_folder;
use super::technique::TechniqueArgs;
use crate::interrupt::{Interrupt, NOTHING_WRITTEN};
use crate::output::{Output, bytes};
use crate::output_files::ReplaceArgs;
use crate::progress::ProgressArgs;

#[derive(Debug, Args)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
pub struct PlanArgs {
    #[command(subcommand)]
    command: Option<PlanCommand>,
    /// Plan file
    #[arg(required = true)]
    plan: Option<PathBuf>,
    /// Folder where the dataset will be written [default: as for ppa generate]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Share of the poses to generate in a temporary folder and time; at least one of every limb
    #[arg(long, default_value_t = 0.0)]
    fraction: f64,
    /// Also estimate how long it takes on a cluster: nodes=N,cores=N (of each node)[,cpus=N (of a task)][,time=LIMIT (of a task)]
    #[arg(long, value_name = "SIZE")]
    cluster: Option<ClusterSize>,
    #[command(flatten)]
    progress: ProgressArgs,
}

#[derive(Debug, Subcommand)]
enum PlanCommand {
    /// Write a plan for cases: every key with its default and what it means
    Init(InitArgs),
}

#[derive(Debug, Args)]
struct InitArgs {
    /// Cases written by `ppa prepare`; those of one scan become limbs of one patient
    #[arg(required = true)]
    cases: Vec<PathBuf>,
    #[command(flatten)]
    technique: TechniqueArgs,
    /// Plan file to write
    #[arg(long, default_value = "plan.toml")]
    out: PathBuf,
    #[command(flatten)]
    replace: ReplaceArgs,
}

#[derive(Debug, Serialize)]
struct Estimate {
    #[serde(flatten)]
    forecast: Forecast,
    threads: usize,
    /// With one core per thread.
    wall_hours: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    cluster: Option<Makespan>,
}

#[derive(Debug, Serialize)]
struct Begun {
    plan: PathBuf,
    limbs: usize,
    #[serde(skip)]
    settings: String,
}

pub fn run(args: &PlanArgs, output: Output) -> anyhow::Result<()> {
    match (&args.command, &args.plan) {
        (Some(PlanCommand::Init(args)), _) => init(args, output),
        (None, Some(plan)) => forecast_of(plan, args, output),
        (None, None) => bail!("a plan file is missing"),
    }
}

fn init(args: &InitArgs, output: Output) -> anyhow::Result<()> {
    let mut outputs = args.replace.outputs();
    outputs.file("--out", &args.out, &[".toml"])?;
    let mut plan = Plan::of_cases(args.cases.iter().map(PathBuf::as_path))?;
    args.technique.apply(&mut plan.xray);
    plan.write_commented(&args.out)?;
    let begun = Begun {
        plan: args.out.clone(),
        limbs: plan.cases.len(),
        settings: args.technique.describe(),
    };
    output.print(&begun, |begun| {
        format!(
            "{}: {}, {}; ppa plan {} estimates its cost",
            begun.plan.display(),
            count(begun.limbs, "limb"),
            begun.settings,
            shell_quoted(&begun.plan.to_string_lossy())
        )
    })
}

fn forecast_of(file: &Path, args: &PlanArgs, output: Output) -> anyhow::Result<()> {
    let plan = Plan::read(file)?;
    let root = match &args.out {
        Some(out) => out.clone(),
        None => dataset_folder(file)?,
    };
    let watch = args.progress.watch("pose", output);
    let interrupt = Interrupt::listen()?;
    let stop = interrupt.flag();
    let forecast = forecast(&plan, &root, args.fraction, stop, &|p| watch.report(p));
    let forecast = interrupt.or_how(forecast, || NOTHING_WRITTEN.to_owned())?;
    watch.finish();
    let threads = rayon::current_num_threads();
    let estimate = Estimate {
        wall_hours: forecast.cpu_hours / threads as f64,
        threads,
        cluster: match &args.cluster {
            Some(size) => Some(on_cluster(&forecast, plan.xray.analog.is_some(), size)?),
            None => None,
        },
        forecast,
    };
    output.print(&estimate, describe)?;
    // The measurements are reported even if the dataset does not fit.
    Ok(estimate.forecast.fits(&root)?)
}

/// Divides the plan as `ppa submit` would; `resumes` as in [`PoseCost`].
fn on_cluster(forecast: &Forecast, resumes: bool, size: &ClusterSize) -> anyhow::Result<Makespan> {
    let cost = PoseCost {
        pose_cpu_s: forecast.cpu_s_per_unit,
        limb_cpu_s: forecast.cpu_s_per_limb,
        resumes,
    };
    let divided = bundle(forecast.pose_jobs as u64, cost, size.cpus, size.time)?;
    let error = forecast.cpu_s_per_unit_error.unwrap_or(0.0);
    let pose_sd_s = error * (forecast.measured as f64).sqrt();
    Ok(makespan(&divided, pose_sd_s, size))
}

fn describe(estimate: &Estimate) -> String {
    let f = &estimate.forecast;
    let error = f.cpu_s_per_unit_error;
    let error = error.map_or(String::new(), |error| format!(" ± {error:.2}"));
    let free = f.free_bytes;
    let free = free.map_or(String::new(), |free| format!(", {} are free", bytes(free)));
    let cluster = estimate.cluster.map(|found| {
        format!(
            "\ncluster    {} of up to {:.0} minutes, {} at a time: {:.2} hours without queue and merge, of which {:.2} for the slowest; \
             {:.2} core hours; {} of disk until the shards are removed",
            count(found.shards, "shard"),
            (found.task_s / 60.0).ceil(),
            found.at_once,
            found.hours,
            found.straggler_hours,
            found.core_hours,
            bytes(2 * f.bytes)
        )
    });
    format!(
        "plan       {}, {}, {}, {}\n\
         measured   {}: {:.2}{error} s of processor time each; {:.1} s to prepare a limb\n\
         forecast   {:.2} CPU hours, {:.2} hours on {}; {} of disk{free}{}",
        count(f.limbs, "limb"),
        count(f.pose_jobs, "pose"),
        count(f.depth_images, "depth image"),
        count(f.radiographs, "radiograph"),
        count(f.measured, "pose"),
        f.cpu_s_per_unit,
        f.cpu_s_per_limb,
        f.cpu_hours,
        estimate.wall_hours,
        count(estimate.threads, "thread"),
        bytes(f.bytes),
        cluster.unwrap_or_default()
    )
}
