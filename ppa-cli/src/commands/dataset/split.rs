//! `ppa dataset split`: splits persons into parts for training and testing.

use std::path::PathBuf;

use clap::Args;
use ppa_core::text::numbers;
use ppa_dataset::Split;
use ppa_dataset::published::Published;

use crate::output::Output;
use crate::output_files::{ReplaceArgs, require_same};

#[derive(Debug, Args)]
#[command(after_long_help = "\
The split is written into the dataset, as splits/NAME.json. It is by person: both feet of a person are in one part. To choose the \
persons yourself, edit the file; `ppa dataset check` refuses one with a person in two parts or in none.")]
pub struct SplitArgs {
    /// Dataset in either layout
    dataset: PathBuf,
    /// Name of the split
    #[arg(long, default_value = "default")]
    name: String,
    /// A part and its share of the persons, relative to the others
    #[arg(long = "part", value_name = "NAME=SHARE", value_parser = part,
        default_values = ["train=0.7", "val=0.15", "test=0.15"])]
    parts: Vec<(String, f64)>,
    /// Seed of the split: another one draws other persons
    #[arg(long, default_value_t = 0)]
    seed: u64,
    #[command(flatten)]
    replace: ReplaceArgs,
}

fn part(text: &str) -> Result<(String, f64), String> {
    let (name, share) = text
        .split_once('=')
        .ok_or("expected NAME=SHARE, such as train=0.7")?;
    let share = share
        .parse()
        .map_err(|_| format!("{share:?} is not a number"))?;
    Ok((name.to_owned(), share))
}

pub fn run(args: &SplitArgs, output: Output) -> anyhow::Result<()> {
    let name = &args.name;
    let plain = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    anyhow::ensure!(
        !name.is_empty() && name.chars().all(plain),
        "--name is {name:?}, expected letters, digits, _ and -"
    );
    let path = Split::path(&args.dataset, name);
    let patients = Published::read(&args.dataset)?.patients();
    let split = Split::draw(&patients, &args.parts, args.seed)?;
    require_same(&path, split.to_text().as_bytes(), args.replace)?;
    split.write(&args.dataset, name)?;
    output.print(&split, |split| {
        let part = |(name, patients): (&String, &Vec<u32>)| {
            format!("{name}: patient {}", numbers(patients.iter().copied()))
        };
        let parts: Vec<_> = split.parts.iter().map(part).collect();
        format!("{}: {}", path.display(), parts.join("; "))
    })
}
