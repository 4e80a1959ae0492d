//! `ppa plan`: what a plan will take, before anything runs.

use std::path::PathBuf;

use clap::Args;
use ppa_dataset::{Forecast, Plan, forecast};
use ppa_text::count;
use serde::Serialize;

use super::generate::dataset_folder;
use crate::output::{Output, bytes};
use crate::progress::ProgressArgs;

#[derive(Debug, Args)]
pub struct PlanArgs {
    /// Plan file
    plan: PathBuf,
    /// Folder where the dataset will lie [default: as of ppa generate]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Share of the poses to make in a temporary folder and measure; at least one of every limb
    #[arg(long, default_value_t = 0.0)]
    fraction: f64,
    #[command(flatten)]
    progress: ProgressArgs,
}

#[derive(Debug, Serialize)]
struct Told {
    #[serde(flatten)]
    forecast: Forecast,
    threads: usize,
    /// On threads that have a core each.
    wall_hours: f64,
}

pub fn run(args: &PlanArgs, output: Output) -> anyhow::Result<()> {
    let plan = Plan::read(&args.plan)?;
    let root = match &args.out {
        Some(out) => out.clone(),
        None => dataset_folder(&args.plan)?,
    };
    let watch = args.progress.watch("pose", output);
    let forecast = forecast(&plan, &root, args.fraction, &|p| watch.report(p))?;
    watch.finish();
    let threads = rayon::current_num_threads();
    let told = Told {
        wall_hours: forecast.cpu_hours / threads as f64,
        threads,
        forecast,
    };
    output.print(&told, describe)?;
    // What was measured is told even then.
    Ok(told.forecast.fits(&root)?)
}

fn describe(told: &Told) -> String {
    let f = &told.forecast;
    let error = f.cpu_s_per_unit_error;
    let error = error.map_or(String::new(), |error| format!(" ± {error:.2}"));
    let free = f.free_bytes;
    let free = free.map_or(String::new(), |free| format!(", {} are free", bytes(free)));
    format!(
        "plan       {}, {}, {}, {}\n\
         measured   {}: {:.2}{error} s of processor time each; {:.1} s to prepare a limb\n\
         forecast   {:.2} CPU hours, {:.2} hours on {}; {} of disk{free}",
        count(f.limbs, "limb"),
        count(f.units, "pose"),
        count(f.depth_images, "depth image"),
        count(f.radiographs, "radiograph"),
        count(f.measured, "pose"),
        f.cpu_s_per_unit,
        f.cpu_s_per_limb,
        f.cpu_hours,
        told.wall_hours,
        count(told.threads, "thread"),
        bytes(f.bytes)
    )
}
