//! `ppa label export`: radiographs for readers to grade.

use std::path::{Path, PathBuf};

use anyhow::ensure;
use clap::Args;
use ppa_dataset::labels::{Showing, grading_page, write_key};
use ppa_dataset::{Manifest, write_whole};
use serde::Serialize;

use crate::output::{Output, bytes, working};

/// The page in the folder for readers.
const PAGE: &str = "grading.html";

#[derive(Debug, Args)]
#[command(after_long_help = "\
Give readers the folder: it holds one page that needs no network. Open it in a browser, grade by key, save the grades as \
CSV. Names and order of the pictures tell nothing; a tenth of them comes twice; all have the same window. Keep the key: \
it tells which picture is which.

  ppa label export dataset --out for_readers --every-deg 5      writes for_readers.key.csv as well
  ppa label import dataset --key for_readers.key.csv grades_anna.csv grades_ben.csv")]
pub struct ExportArgs {
    /// Folder of a dataset
    dataset: PathBuf,
    /// Folder for readers
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// The key, outside of that folder [default: beside it, with .key.csv added to its name]
    #[arg(long, value_name = "FILE")]
    key: Option<PathBuf>,
    /// Seed of names and order: another one for each reader, if each shall see another order
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Show only poses at multiples of this angle
    #[arg(long, value_name = "DEGREES", default_value_t = 0.5)]
    every_deg: f64,
}

#[derive(Debug, Serialize)]
struct Exported {
    page: PathBuf,
    key: PathBuf,
    pictures: usize,
    repeats: usize,
    bytes: u64,
}

pub fn run(args: &ExportArgs, output: Output) -> anyhow::Result<()> {
    ensure!(
        args.every_deg >= 0.5 && (2.0 * args.every_deg).fract() == 0.0,
        "--every-deg is {}, expected a multiple of 0.5",
        args.every_deg
    );
    let key = args.key.clone().unwrap_or_else(|| beside(&args.out));
    ensure!(
        !std::path::absolute(&key)?.starts_with(std::path::absolute(&args.out)?),
        "the key {} would lie in the folder for readers, {}",
        key.display(),
        args.out.display()
    );
    let page = args.out.join(PAGE);
    for path in [&key, &page] {
        ensure!(
            !path.exists(),
            "{} is there already, and grades may depend on it; choose another --out",
            path.display()
        );
    }
    let working = working("collecting radiographs");
    let manifest = Manifest::read(&args.dataset)?;
    let shown = Showing::of_dataset(&manifest, args.seed, args.every_deg);
    let html = grading_page(&args.dataset, &shown)?;
    write_key(&key, &shown)?;
    write_whole(&page, html.as_bytes())?;
    working.finish_and_clear();
    let images: std::collections::HashSet<_> = shown.iter().map(|showing| &showing.image).collect();
    let exported = Exported {
        page,
        key,
        pictures: shown.len(),
        repeats: shown.len() - images.len(),
        bytes: html.len() as u64,
    };
    output.print(&exported, |done| {
        format!(
            "{}: {} pictures, {} of them repeats ({})\nkeep the key to yourself: {}",
            done.page.display(),
            done.pictures,
            done.repeats,
            bytes(done.bytes),
            done.key.display()
        )
    })
}

fn beside(folder: &Path) -> PathBuf {
    // `out/` and `out` are one folder.
    let mut name = folder.components().as_path().as_os_str().to_owned();
    name.push(".key.csv");
    name.into()
}
