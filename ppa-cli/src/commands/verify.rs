//! `ppa verify`: regenerates a sample of a dataset and compares it.

use std::path::{Path, PathBuf};

use anyhow::bail;
use clap::Args;
use ppa_core::text::count;
use ppa_dataset::Findings;
use ppa_generate::{Plan, plan_of_dataset, verify};
use serde::Serialize;

use crate::interrupt::{Interrupt, NOTHING_WRITTEN};
use crate::output::Output;
use crate::progress::ProgressArgs;

#[derive(Debug, Args)]
pub struct VerifyArgs {
    /// Folder or archive of a dataset, or of a shard
    dataset: PathBuf,
    /// Plan it was made from [default: the file next to the folder, named after it]
    #[arg(long, value_name = "FILE")]
    plan: Option<PathBuf>,
    /// Share of the poses to make again and compare, at least one pose
    #[arg(long, default_value_t = 0.001)]
    fraction: f64,
    /// Seed of the sample: another number selects other poses
    #[arg(long, default_value_t = 0)]
    sample_seed: u64,
    #[command(flatten)]
    progress: ProgressArgs,
}

#[derive(Debug, Serialize)]
struct Verified {
    units: usize,
    images: usize,
    remade: usize,
    #[serde(skip_serializing_if = "Findings::is_empty")]
    findings: Findings,
}

pub fn run(args: &VerifyArgs, output: Output) -> anyhow::Result<()> {
    let path = match &args.plan {
        Some(path) => path.clone(),
        None => {
            let beside = plan_of_dataset(&args.dataset);
            anyhow::ensure!(
                beside.exists(),
                "{} does not exist; use --plan to give the plan that {} was made from",
                beside.display(),
                args.dataset.display()
            );
            beside
        }
    };
    let plan = Plan::read(&path)?;
    let watch = args.progress.watch("pose", output);
    let interrupt = Interrupt::listen()?;
    let found = verify(
        &plan,
        &args.dataset,
        args.fraction,
        args.sample_seed,
        interrupt.flag(),
        &|progress| watch.report(progress),
    );
    watch.finish();
    let found = interrupt.or_how(found, || NOTHING_WRITTEN.to_owned())?;
    let problems: Vec<_> = [found.check.problems, found.different].concat();
    require_none(&args.dataset, &problems)?;
    let verified = Verified {
        units: found.check.pose_jobs,
        images: found.check.images,
        remade: found.remade,
        findings: found.findings,
    };
    output.print(&verified, |v| {
        format!(
            "{}: {} of {} unchanged; {} made again with the same result",
            args.dataset.display(),
            count(v.images, "image"),
            count(v.units, "pose"),
            count(v.remade, "pose")
        )
    })
}

/// Fails with the first problems in one sentence.
pub fn require_none(dataset: &Path, problems: &[impl ToString]) -> anyhow::Result<()> {
    const TOLD: usize = 5;
    if problems.is_empty() {
        return Ok(());
    }
    let report: Vec<_> = problems
        .iter()
        .take(TOLD)
        .map(ToString::to_string)
        .collect();
    let more = match problems.len().saturating_sub(TOLD) {
        0 => String::new(),
        more => format!("; and {more} more"),
    };
    bail!("{}: {}{more}", dataset.display(), report.join("; "))
}
