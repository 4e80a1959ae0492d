//! `ppa xray merge`: joins the parts of a run to one radiograph.

use std::path::{Path, PathBuf};

use clap::Args;
use ppa_generate::Plan;
use ppa_xray::AnalogTally;

use super::report::Report;
use crate::interrupt::{NOTHING_WRITTEN, ends_at_once};
use crate::output::{Output, Stopwatch, working};
use crate::output_files::ReplaceArgs;

#[derive(Debug, Args)]
pub struct MergeArgs {
    /// Tallies of all parts of one run, in any order
    #[arg(required = true)]
    tallies: Vec<PathBuf>,
    /// Radiograph to write: 16-bit PNG; may be left out if something else is written
    #[arg(long, required_unless_present_any = ["exr", "tally"])]
    out: Option<PathBuf>,
    /// Tallies to write: OpenEXR with one layer per category
    #[arg(long)]
    exr: Option<PathBuf>,
    /// Tally of the whole run to write, as one run would have left it
    #[arg(long)]
    tally: Option<PathBuf>,
    /// Take the presentation from this plan
    #[arg(long)]
    plan: Option<PathBuf>,
    #[command(flatten)]
    replace: ReplaceArgs,
}

pub fn run(args: &MergeArgs, output: Output) -> anyhow::Result<()> {
    let mut outputs = args.replace.outputs();
    outputs.optional("--out", args.out.as_ref(), &[".png"])?;
    outputs.optional("--exr", args.exr.as_ref(), &[".exr"])?;
    outputs.optional("--tally", args.tally.as_ref(), &[])?;
    let stoppable = ends_at_once(NOTHING_WRITTEN)?;
    let watch = Stopwatch::start();
    let plan = match &args.plan {
        Some(path) => Plan::read(path)?,
        None => Plan::new(Vec::new()),
    };
    let working = working("merging");
    let tally = AnalogTally::merge(&args.tallies)?;
    let radiograph = tally.radiograph();
    drop(stoppable);
    let mut written: Vec<&Path> = Vec::new();
    if let Some(out) = &args.out {
        radiograph.write_png(out, &plan.xray.presentation)?;
        written.push(out);
    }
    if let Some(exr) = &args.exr {
        radiograph.write_exr(exr)?;
        written.push(exr);
    }
    if let Some(path) = &args.tally {
        tally.write(path)?;
        written.push(path);
    }
    working.finish_and_clear();
    let report = Report::new(&radiograph, tally.dose().as_ref(), watch.read());
    output.print(&report, |report| report.describe(&written))
}
