//! `ppa label import`: labels from the grades of readers.

use std::path::PathBuf;

use clap::Args;
use ppa_core::text::count;
use ppa_dataset::Manifest;
use ppa_label::{Imported, import_grades, read_key};

use crate::output::Output;

#[derive(Debug, Args)]
#[command(after_long_help = "\
Writes labels.json of every limb that was graded: mean and standard deviation (dividing by the number of readers) over \
the readers' first grades. All grades are kept in grades.csv of the dataset: give that file as well to add \
further readers, and to `ppa label agree`. In labels.json readers' labels take the place of computed ones, all of which stay in \
labels.computed.json; radiographs that no reader graded keep their computed label.

  ppa label import dataset --key for_readers.key.csv grades_*.csv
  ppa label import dataset --key second.key.csv dataset/grades.csv carl.csv
  ppa label agree dataset/grades.csv")]
pub struct ImportArgs {
    /// Folder of a dataset
    dataset: PathBuf,
    /// CSV files with the columns image, reader, grade; image is a name of the key or a radiograph of the dataset
    #[arg(required = true)]
    csv: Vec<PathBuf>,
    /// Keys that `ppa label export` wrote
    #[arg(long, value_name = "FILE")]
    key: Vec<PathBuf>,
}

pub fn run(args: &ImportArgs, output: Output) -> anyhow::Result<()> {
    let manifest = Manifest::read(&args.dataset)?;
    let mut shown = Vec::new();
    for key in &args.key {
        shown.extend(read_key(key)?);
    }
    let imported = import_grades(&manifest, &shown, &args.csv)?;
    output.print(&imported, describe)
}

fn describe(done: &Imported) -> String {
    let mut lines = vec![format!(
        "{} labelled by {}; {} set aside",
        count(done.labelled, "radiograph"),
        count(done.readers, "reader"),
        count(done.repeats, "repeat")
    )];
    if done.replaced_computed > 0 {
        lines.push(format!(
            "{} replaced by readers' labels, kept in labels.computed.json",
            count(done.replaced_computed, "computed label")
        ));
    }
    if done.kept_computed > 0 {
        lines.push(format!(
            "{} of the same limbs without a grade: computed label kept",
            count(done.kept_computed, "radiograph")
        ));
    }
    if done.without_label > 0 {
        lines.push(format!(
            "{} of the same limbs without a label: not graded",
            count(done.without_label, "radiograph")
        ));
    }
    lines.join("\n")
}
