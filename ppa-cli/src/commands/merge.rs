//! `ppa merge`: joins the shards of a plan to one dataset.

use std::path::PathBuf;

use clap::Args;
use ppa_generate::{Progress, check, merge};

use super::generate::describe;
use super::verify::require_none;
use crate::interrupt::{Interrupt, ends_at_once};
use crate::output::{Output, working};
use crate::progress::ProgressArgs;

#[derive(Debug, Args)]
pub struct MergeArgs {
    /// Folders or archives written by `ppa generate --shard`, in any order
    #[arg(required = true, value_name = "DIR")]
    shards: Vec<PathBuf>,
    /// Folder of the whole dataset, or an archive NAME.tar: the same bytes as a single run would have written
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Replace what differs from the plan; old images stay until the new ones are complete
    #[arg(long)]
    replace: bool,
    /// Read the merged dataset back and compare every file with what was made
    #[arg(long)]
    verify: bool,
    #[command(flatten)]
    progress: ProgressArgs,
}

pub fn run(args: &MergeArgs, output: Output) -> anyhow::Result<()> {
    let watch = args.progress.watch("pose", output);
    let interrupt = Interrupt::listen()?;
    let report = |progress: Progress<'_>| watch.report(progress);
    let summary = merge(
        &args.shards,
        &args.out,
        args.replace,
        interrupt.flag(),
        &report,
    );
    watch.finish();
    let summary = interrupt.or_how(summary, || watch.how_to_resume())?;
    if args.verify {
        let _stoppable = ends_at_once(
            "while the merged dataset was read back; repeat the command to read it again",
        )?;
        let working = working("reading back");
        let problems = check(&args.out)?.problems;
        working.finish_and_clear();
        require_none(&args.out, &problems)?;
    }
    output.print(&summary, |s| describe(s, &args.out, "added"))
}
