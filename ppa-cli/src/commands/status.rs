//! `ppa status`: generation progress.

use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::Args;
use ppa_cluster::{ClusterFolder, FolderError, Slurm, Submission};
use ppa_core::text::count;
use ppa_generate::{Status, status};

use crate::cluster_report::ClusterReport;
use crate::output::{Output, bytes};
use crate::stderr;

#[derive(Debug, Args)]
pub struct StatusArgs {
    /// Folder or archive of a dataset or a shard, or the folder of the jobs of `ppa submit`
    dataset: PathBuf,
    /// Repeat every ten seconds until nothing runs or waits
    #[arg(long)]
    watch: bool,
}

/// Time between two reports of `--watch`.
const PAUSE: Duration = Duration::from_secs(10);

pub fn run(args: &StatusArgs, output: Output) -> anyhow::Result<()> {
    loop {
        let under_way = match ClusterFolder::is_one(&args.dataset) {
            true => jobs(&args.dataset, output)?,
            false => {
                let status = status(&args.dataset)?;
                output.print(&status, describe)?;
                status.running
            }
        };
        if !(args.watch && under_way) {
            return Ok(());
        }
        std::thread::sleep(PAUSE);
    }
}

/// Reports the shards of a plan on a cluster, and returns whether any of them is running or waiting.
fn jobs(root: &Path, output: Output) -> anyhow::Result<bool> {
    let folder = ClusterFolder::open(root)?;
    let submission = Submission::read(&folder.submission())?;
    let submission = submission.ok_or_else(|| FolderError::NotSubmitted(root.to_owned()))?;
    let queue = Slurm.queue(&folder.job_name()).unwrap_or_else(|error| {
        stderr::warning(&format!(
            "running and pending shards are shown as failed or missing: {error}"
        ));
        Vec::new()
    });
    let report = ClusterReport::of(&folder, &submission, &queue)?;
    output.print(&report, ClusterReport::describe)?;
    Ok(report.is_under_way())
}

fn describe(status: &Status) -> String {
    let mut lines = vec![format!(
        "shard {}: {} of {} made, {}, {}{}",
        status.part,
        status.made,
        count(status.pose_jobs, "pose"),
        count(status.images, "image"),
        bytes(status.bytes),
        match (status.running, status.complete) {
            (true, _) => ", being written now",
            (false, true) => ", complete",
            (false, false) => ", incomplete",
        }
    )];
    if status.findings > 0 {
        lines.push(format!(
            "findings   {}, of which severe and not acknowledged: {}",
            status.findings, status.open_findings
        ));
    }
    for limb in &status.limbs {
        let (patient, side) = (limb.limb.patient, limb.limb.side_letter());
        lines.push(format!(
            "patient {patient} {side}  {} of {}",
            limb.made, limb.pose_jobs
        ));
    }
    lines.join("\n")
}
