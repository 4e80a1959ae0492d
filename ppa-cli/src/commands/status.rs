//! `ppa status`: generation progress.

use std::path::PathBuf;

use clap::Args;
use ppa_core::text::count;
use ppa_generate::{Status, status};

use crate::output::{Output, bytes};

#[derive(Debug, Args)]
pub struct StatusArgs {
    /// Folder of a dataset, or of a shard
    dataset: PathBuf,
}

pub fn run(args: &StatusArgs, output: Output) -> anyhow::Result<()> {
    output.print(&status(&args.dataset)?, describe)
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
