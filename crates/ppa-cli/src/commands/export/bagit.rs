//! `ppa export bagit`: a dataset as a bag.

use std::path::PathBuf;

use clap::Args;
use ppa_dataset::export::bag;
use ppa_text::count;

use crate::output::{Output, bytes, working};

#[derive(Debug, Args)]
#[command(after_long_help = "\
Every image must be as in manifest.jsonl. Hidden files and grades.csv, which names readers, stay behind; links are refused.")]
pub struct BagitArgs {
    /// Dataset
    dataset: PathBuf,
    /// Folder of the bag, which must not be there yet
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

pub fn run(args: &BagitArgs, output: Output) -> anyhow::Result<()> {
    let working = working("copying files");
    let bag = bag(&args.dataset, &args.out)?;
    working.finish_and_clear();
    output.print(&bag, |bag| {
        format!(
            "{}: {}, {}",
            args.out.display(),
            count(bag.files, "file"),
            bytes(bag.bytes)
        )
    })
}
