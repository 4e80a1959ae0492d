//! `ppa export metadata`: Croissant and RO-Crate.

use std::path::PathBuf;

use clap::Args;
use ppa_dataset::export::{Metadata, write_metadata};
use serde_json::json;

use crate::output::Output;
use crate::output_files::ReplaceArgs;

#[derive(Debug, Args)]
#[command(after_long_help = "\
Writes manifest.csv, croissant.json (Croissant 1.1), ro-crate-metadata.json (RO-Crate 1.1, Process Run profile) and datasheet.md \
(Datasheets for Datasets; questions that no program can answer stay open) into the dataset. A datasheet.md that is there and differs stays; \
the new one is then datasheet.new.md.

  ppa export metadata dataset --name ankles --date 2026-11-21 \\
      --license https://creativecommons.org/licenses/by/4.0/")]
pub struct MetadataArgs {
    /// Dataset that `ppa generate` finished
    dataset: PathBuf,
    /// Name of the dataset
    #[arg(long)]
    name: String,
    /// Address of its licence
    #[arg(long, value_name = "URL")]
    license: String,
    /// Day of publication
    #[arg(long, value_name = "YYYY-MM-DD")]
    date: String,
    /// Split whose parts are written to the table
    #[arg(long, value_name = "NAME")]
    split: Option<String>,
    #[command(flatten)]
    replace: ReplaceArgs,
}

pub fn run(args: &MetadataArgs, output: Output) -> anyhow::Result<()> {
    let metadata = Metadata {
        name: args.name.clone(),
        license: args.license.clone(),
        date: args.date.clone(),
    };
    let (split, replace) = (args.split.as_deref(), args.replace.is_given());
    let files = write_metadata(&args.dataset, &metadata, split, replace)?;
    output.print(&json!({ "files": files }), |_| {
        format!("{}: {}", args.dataset.display(), files.join(", "))
    })
}
