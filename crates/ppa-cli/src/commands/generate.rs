//! `ppa generate`: the dataset of a plan.

use std::path::PathBuf;

use clap::Args;
use ppa_dataset::{Plan, Progress, Summary, generate};

use crate::output::{Output, bar};

#[derive(Debug, Args)]
pub struct GenerateArgs {
    /// Plan file
    plan: PathBuf,
    /// Folder of the dataset [default: a folder beside the plan, named after it]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Use another seed than the plan's
    #[arg(long)]
    seed: Option<u64>,
}

pub fn run(args: &GenerateArgs, output: Output) -> anyhow::Result<()> {
    let mut plan = Plan::read(&args.plan)?;
    plan.seed = args.seed.unwrap_or(plan.seed);
    let out = match &args.out {
        Some(out) => out.clone(),
        None => args.plan.with_extension(""),
    };
    anyhow::ensure!(
        out != args.plan,
        "{} has no extension: name a folder with --out",
        out.display()
    );
    let summary = with_progress(&plan, &out)?;
    output.print(&summary, |s| describe(s, &out))
}

/// Generates under a progress bar.
pub fn with_progress(plan: &Plan, out: &std::path::Path) -> anyhow::Result<Summary> {
    let poses = bar("poses");
    let summary = generate(plan, out, &|progress| match progress {
        Progress::Total(total) => poses.set_length(total as u64),
        Progress::Done => poses.inc(1),
    })?;
    poses.finish_and_clear();
    Ok(summary)
}

/// The summary in words.
pub fn describe(summary: &Summary, out: &std::path::Path) -> String {
    format!(
        "{}: {} depth images and {} radiographs of {} poses, {} of them made now",
        out.display(),
        summary.depth_images,
        summary.radiographs,
        summary.units,
        summary.made
    )
}
