//! `ppa qa`: a dataset on one page.

use std::path::PathBuf;

use clap::Args;
use ppa_dataset::write_whole;
use ppa_report::qa_page;
use serde_json::json;

use crate::interrupt::{NOTHING_WRITTEN, ends_at_once};
use crate::output::{Output, bytes, working};
use crate::output_files::ReplaceArgs;

#[derive(Debug, Args)]
pub struct QaArgs {
    /// Dataset that `ppa generate` finished
    dataset: PathBuf,
    /// Page to write [default: qa.html in the dataset]
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    #[command(flatten)]
    replace: ReplaceArgs,
}

pub fn run(args: &QaArgs, output: Output) -> anyhow::Result<()> {
    let inside = || args.dataset.join("qa.html");
    let path = args.out.clone().unwrap_or_else(inside);
    let mut outputs = args.replace.outputs();
    outputs.file_in_new_folder("--out", &path, &[".html", ".htm"])?;
    let stoppable = ends_at_once(NOTHING_WRITTEN)?;
    let working = working("looking at all images");
    let page = qa_page(&args.dataset)?;
    working.finish_and_clear();
    drop(stoppable);
    write_whole(&path, page.as_bytes())?;
    let size = page.len() as u64;
    output.print(&json!({ "page": path, "bytes": size }), |_| {
        format!(
            "{}: {}; open it in any browser",
            path.display(),
            bytes(size)
        )
    })
}
