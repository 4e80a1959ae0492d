//! `ppa export table`: the manifest as a table.

use std::path::PathBuf;

use clap::Args;
use ppa_core::text::count;
use ppa_dataset::export::Table;
use serde::Serialize;

use crate::output::Output;
use crate::output_files::ReplaceArgs;

#[derive(Debug, Args)]
pub struct TableArgs {
    /// Dataset that `ppa generate` finished
    dataset: PathBuf,
    /// File to write: .csv or .parquet
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Split whose parts are written to the column split
    #[arg(long, value_name = "NAME")]
    split: Option<String>,
    #[command(flatten)]
    replace: ReplaceArgs,
}

#[derive(Debug, Serialize)]
struct Written {
    rows: usize,
    columns: usize,
}

pub fn run(args: &TableArgs, output: Output) -> anyhow::Result<()> {
    let mut outputs = args.replace.outputs();
    let endings: &[&str] = match cfg!(feature = "parquet") {
        true => &[".csv", ".parquet"],
        false => &[".csv"],
    };
    outputs.file_in_new_folder("--out", &args.out, endings)?;
    let table = Table::of_dataset(&args.dataset, args.split.as_deref())?;
    table.write(&args.out)?;
    let written = Written {
        rows: table.rows(),
        columns: table.columns.len(),
    };
    output.print(&written, |w| {
        format!(
            "{}: {}, {}",
            args.out.display(),
            count(w.rows, "file"),
            count(w.columns, "column")
        )
    })
}
