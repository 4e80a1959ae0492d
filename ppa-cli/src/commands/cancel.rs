//! `ppa cancel`: cancels the jobs of a folder.

use std::path::PathBuf;

use clap::Args;
use ppa_cluster::{ClusterFolder, Slurm};
use ppa_core::text::count;
use serde::Serialize;

use crate::output::Output;

#[derive(Debug, Args)]
pub struct CancelArgs {
    /// Folder given to `ppa submit` as --out; its files are kept
    jobs: PathBuf,
}

#[derive(Debug, Serialize)]
struct Cancelled {
    cancelled: Vec<String>,
}

pub fn run(args: &CancelArgs, output: Output) -> anyhow::Result<()> {
    let folder = ClusterFolder::open(&args.jobs)?;
    let _lock = folder.lock()?;
    let queue = Slurm.queue(&folder.job_name())?;
    let mut ids: Vec<_> = queue.iter().map(|job| job.array_id()).collect();
    ids.sort_unstable();
    ids.dedup();
    if !ids.is_empty() {
        Slurm.cancel(&ids)?;
    }
    let cancelled = Cancelled {
        cancelled: ids.into_iter().map(str::to_owned).collect(),
    };
    output.print(&cancelled, |done| match done.cancelled.as_slice() {
        [] => format!("{}: no pending or running jobs", args.jobs.display()),
        ids => format!(
            "{}: cancelled {}: {}; finished poses are kept",
            args.jobs.display(),
            count(ids.len(), "job"),
            ids.join(", ")
        ),
    })
}
