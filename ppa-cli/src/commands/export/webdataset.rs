//! `ppa export webdataset`: image pairs in tar archives.

use std::num::NonZeroUsize;
use std::path::PathBuf;

use clap::Args;
use ppa_core::text::count;
use ppa_dataset::export::web_dataset;

use crate::interrupt::{Interrupt, NOTHING_WRITTEN};
use crate::output::{Output, working};
use crate::output_files::OutputFiles;

#[derive(Debug, Args)]
#[command(after_long_help = "\
A sample is NAME.left.png, NAME.right.png, NAME.xray.png and NAME.json (person, pose, regions, label). With --split each part has \
archives of its own, train-000000.tar; a person is in one part only.")]
pub struct WebdatasetArgs {
    /// Dataset in either published layout
    dataset: PathBuf,
    /// Folder of the archives, which must not exist
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Image pairs per archive
    #[arg(long, default_value = "1000", value_name = "N")]
    per_shard: NonZeroUsize,
    /// Split of the dataset
    #[arg(long, value_name = "NAME")]
    split: Option<String>,
}

pub fn run(args: &WebdatasetArgs, output: Output) -> anyhow::Result<()> {
    OutputFiles::new().folder("--out", &args.out)?;
    let interrupt = Interrupt::listen()?;
    let working = working("writing archives");
    let per_shard = args.per_shard.get();
    let (split, stop) = (args.split.as_deref(), interrupt.flag());
    let shards = web_dataset(&args.dataset, &args.out, per_shard, split, stop);
    let shards = interrupt.or_how(shards, || NOTHING_WRITTEN.to_owned())?;
    working.finish_and_clear();
    output.print(&shards, |s| {
        format!(
            "{}: {} in {}",
            args.out.display(),
            count(s.samples, "image pair"),
            count(s.shards, "archive")
        )
    })
}
