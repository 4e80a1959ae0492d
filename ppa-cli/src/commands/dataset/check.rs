//! `ppa dataset check`: checks every image and list of a dataset.

use std::path::{Path, PathBuf};

use clap::Args;
use ppa_core::text::count;
use ppa_dataset::Split;
use ppa_dataset::published::{Flaw, Inspection, Published, inspect};
use ppa_generate::{FolderError, Problem};
use serde::Serialize;

use super::super::verify::require_none;
use crate::interrupt::{NOTHING_WRITTEN, ends_at_once};
use crate::output::{Output, working};

#[derive(Debug, Args)]
#[command(after_long_help = "\
Every PNG is decoded and compared with its region of interest, with the images of other persons and, where there is one, with \
manifest.jsonl, as are tallies. Lists are compared with checksums.sha256, labels and splits with labels.sha256 and, where the folder .ppa is there, everything that ppa wrote \
with its records. Labels must be those of the radiographs that are there now; a scan may not belong to two patients; \
radiographs, labels and regions of poses without depth images are reported. Splits are those in the dataset's folder splits: each person in exactly one part.

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
    let recorded = against_records(&args.dataset)?;
    let found = inspect(&args.dataset);
    working.finish_and_clear();
    let mut problems: Vec<_> = match &found {
        Ok(found) => found.flaws.iter().map(Flaw::to_string).collect(),
        // A deviation from the layout may be caused by the damage.
        Err(_) => Vec::new(),
    };
    for (file, problem) in recorded {
        let known = file.is_some_and(|file| problems.iter().any(|flaw| flaw.contains(&file)));
        if !known {
            problems.push(problem);
        }
    }
    let mut splits = Vec::new();
    if found.is_ok() {
        splits = Split::names(&args.dataset)?;
        problems.extend(split_problems(&args.dataset, &splits)?);
    }
    require_none(&args.dataset, &problems)?;
    let found = found?;
    output.print(&Checked { found, splits }, describe)
}

fn split_problems(dataset: &Path, splits: &[String]) -> anyhow::Result<Vec<String>> {
    let patients = Published::read(dataset)?.patients();
    let problem = |name: &String| {
        let path = Split::path(dataset, name);
        let checked = Split::read(&path).and_then(|split| split.check(&patients));
        let error = anyhow::Error::from(checked.err()?);
        Some(format!("{}: {error:#}", path.display()))
    };
    Ok(splits.iter().filter_map(problem).collect())
}

/// Differences from the records of the dataset, if there are any, with the file concerned.
fn against_records(dataset: &Path) -> anyhow::Result<Vec<(Option<String>, String)>> {
    if !dataset.join(".ppa").is_dir() {
        return Ok(Vec::new());
    }
    let described = |problem: &Problem| (problem.file().map(str::to_owned), problem.to_string());
    match ppa_generate::check(dataset) {
        Ok(check) => Ok(check.problems.iter().map(described).collect()),
        Err(error @ FolderError::Busy(_)) => Err(error.into()),
        // A file without which the others cannot be checked.
        Err(error) => Ok(vec![(None, format!("{:#}", anyhow::Error::from(error)))]),
    }
}

fn describe(checked: &Checked) -> String {
    let found = &checked.found;
    format!(
        "{}, {}, {}: {} ({} with region), {}, {} labelled; {}; {}",
        count(found.patients, "person"),
        count(found.limbs, "limb"),
        count(found.pairs, "image pair"),
        count(found.depth_images, "depth image"),
        found.regions,
        count(found.radiographs, "radiograph"),
        count(found.labelled, "pair"),
        if found.manifest {
            "all match manifest.jsonl"
        } else {
            "no manifest.jsonl"
        },
        match checked.splits.len() {
            0 => "no splits".to_owned(),
            _ => format!("splits by person: {}", checked.splits.join(", ")),
        }
    )
}
