//! `ppa export bagit`: a dataset as a BagIt bag.

use std::path::PathBuf;

use clap::Args;
use ppa_core::text::count;
use ppa_dataset::export::bag;

use crate::interrupt::{Interrupt, NOTHING_WRITTEN};
use crate::output::{Output, bytes, working};
use crate::output_files::{OutputFiles, bytes_below, require_room};

#[derive(Debug, Args)]
#[command(after_long_help = "\
Every image must be as in manifest.jsonl. Hidden files and grades.csv, which names readers, stay behind; links are refused.")]
pub struct BagitArgs {
    /// Dataset
    dataset: PathBuf,
    /// Folder of the bag, which must not exist
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

pub fn run(args: &BagitArgs, output: Output) -> anyhow::Result<()> {
    OutputFiles::new().folder("--out", &args.out)?;
    require_room(&args.out, bytes_below(&args.dataset))?;
    let interrupt = Interrupt::listen()?;
    let working = working("copying files");
    let bag = bag(&args.dataset, &args.out, interrupt.flag());
    let bag = interrupt.or_how(bag, || NOTHING_WRITTEN.to_owned())?;
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
