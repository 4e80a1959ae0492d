//! `ppa dataset check`: whether a training program can use a dataset.

use std::path::PathBuf;

use anyhow::Context;
use clap::Args;
use ppa_dataset::Split;
use ppa_dataset::published::{Inspection, Published, inspect};
use serde::Serialize;

use super::super::verify::require_none;
use crate::interrupt::{NOTHING_WRITTEN, ends_at_once};
use crate::output::{Output, working};

#[derive(Debug, Args)]
#[command(after_long_help = "\
Every PNG is decoded and compared with its region of interest, with the images of other persons and, where there is one, with \
manifest.jsonl, as are tallies. Labels must be those of the radiographs that are there now; scans may not stand under two patients; \
radiographs, labels and regions of poses without depth images are told. Splits are those in the dataset's folder splits: each person in exactly one part.

`ppa verify` makes a sample again and compares; this command needs no plan and takes datasets of others as well.")]
pub struct CheckArgs {
    /// Folder with the folders patient_N (synthetic layout) or patient_N_l and patient_N_r (specimen layout)
    dataset: PathBuf,
}

#[derive(Debug, Serialize)]
struct Checked {
    #[serde(flatten)]
    found: Inspection,
    splits: Vec<String>,
}

pub fn run(args: &CheckArgs, output: Output) -> anyhow::Result<()> {
    let _stoppable = ends_at_once(NOTHING_WRITTEN)?;
    let working = working("reading all images");
    let found = inspect(&args.dataset)?;
    working.finish_and_clear();
    require_none(&args.dataset, &found.flaws)?;
    let patients = Published::read(&args.dataset)?.patients();
    let splits = Split::names(&args.dataset)?;
    for name in &splits {
        let path = Split::path(&args.dataset, name);
        let checked = Split::read(&path).and_then(|split| split.check(&patients));
        checked.with_context(|| path.display().to_string())?;
    }
    output.print(&Checked { found, splits }, describe)
}

fn describe(checked: &Checked) -> String {
    let found = &checked.found;
    format!(
        "{} persons, {} limbs, {} image pairs: {} depth images ({} with region), {} radiographs, {} pairs labelled; {}; {}",
        found.patients,
        found.limbs,
        found.pairs,
        found.depth_images,
        found.regions,
        found.radiographs,
        found.labelled,
        if found.manifest {
            "all as in manifest.jsonl"
        } else {
            "no manifest.jsonl"
        },
        match checked.splits.len() {
            0 => "no splits".to_owned(),
            _ => format!("splits by person: {}", checked.splits.join(", ")),
        }
    )
}
