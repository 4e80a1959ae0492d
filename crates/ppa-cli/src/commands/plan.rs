//! `ppa plan`: what a plan will take, before anything runs.

use std::path::PathBuf;

use clap::Args;
use ppa_dataset::{Forecast, Plan, forecast};
use serde::Serialize;

use super::generate::dataset_folder;
use crate::interrupt::{Interrupt, NOTHING_WRITTEN};
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
    let watch = args.progress.watch("poses measured", output);
    let interrupt = Interrupt::listen()?;
    let stop = interrupt.flag();
    let forecast = forecast(&plan, &root, args.fraction, stop, &|p| watch.report(p));
    let forecast = interrupt.or_how(forecast, || NOTHING_WRITTEN.to_owned())?;
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
        "plan       {} limbs, {} poses, {} depth images, {} radiographs\n\
         measured   {} poses: {:.2}{error} s of processor time each; {:.1} s to prepare a limb\n\
         forecast   {:.2} CPU hours, {:.2} hours on {} threads; {} of disk{free}",
        f.limbs,
        f.units,
        f.depth_images,
        f.radiographs,
        f.measured,
        f.cpu_s_per_unit,
        f.cpu_s_per_limb,
        f.cpu_hours,
        told.wall_hours,
        told.threads,
        bytes(f.bytes)
    )
}
