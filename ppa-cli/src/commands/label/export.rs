//! `ppa label export`: radiographs for readers to grade.

use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use clap::Args;
use ppa_core::text::count;
use ppa_dataset::{Manifest, write_whole};
use ppa_label::{PICTURES_PER_PAGE, PageNumber, ReaderCase, grading_page, write_key};
use serde::Serialize;

use crate::findings::repeat_of_datasets;
use crate::interrupt::{Interrupt, NOTHING_WRITTEN};
use crate::output::{Output, bytes, working};
use crate::output_files::OutputFiles;

#[derive(Debug, Args)]
#[command(after_long_help = "\
Give readers the folder: it holds a page that needs no network, or several of 200 pictures. Open each in a browser, grade by key, save the grades as \
CSV. Names and order of the pictures are random; a tenth of them comes twice; all have the same window. Keep the key: \
it identifies the pictures.

  ppa label export dataset --out for_readers --every-deg 5   # and the key
  ppa label import dataset --key for_readers.key.csv grades_anna.csv")]
pub struct ExportArgs {
    /// Folder of a dataset
    dataset: PathBuf,
    /// Folder for readers
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Key file, outside that folder [default: next to it, with .key.csv added to its name]
    #[arg(long, value_name = "FILE")]
    key: Option<PathBuf>,
    /// Seed of names and order; give each reader a seed of their own for a different order
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Show only poses at multiples of this angle
    #[arg(long, value_name = "DEGREES", default_value_t = 0.5)]
    every_deg: f64,
}

#[derive(Debug, Serialize)]
struct Exported {
    pages: Vec<PathBuf>,
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
        "the key {} would be in the folder for readers, {}",
        key.display(),
        args.out.display()
    );
    repeat_of_datasets(std::iter::once(&*args.dataset))?;
    let working = working("collecting radiographs");
    let manifest = Manifest::read(&args.dataset)?;
    let shown = ReaderCase::of_dataset(&manifest, args.seed, args.every_deg);
    let pages = pages(&args.out, shown.len());
    for path in pages.iter().chain([&key]) {
        ensure!(
            !path.exists(),
            "{} already exists, and grades may depend on it; choose another --out",
            path.display()
        );
    }
    let mut outputs = OutputFiles::new();
    outputs.file_in_new_folder("--key", &key, &[".csv"])?;
    for page in &pages {
        outputs.file_in_new_folder("--out", page, &[".html"])?;
    }
    let interrupt = Interrupt::listen()?;
    let mut size = 0;
    let of = pages.len();
    for (i, path) in pages.iter().enumerate() {
        if interrupt.is_asked() {
            for written in &pages[..i] {
                std::fs::remove_file(written)
                    .with_context(|| format!("cannot remove {}", written.display()))?;
            }
            return Err(interrupt.stopped(NOTHING_WRITTEN));
        }
        let number = PageNumber { page: i + 1, of };
        let first = (i * PICTURES_PER_PAGE).min(shown.len());
        let last = (first + PICTURES_PER_PAGE).min(shown.len());
        let html = grading_page(&args.dataset, &shown[first..last], number)?;
        size += html.len() as u64;
        write_whole(path, html.as_bytes())?;
    }
    write_key(&key, &shown)?;
    working.finish_and_clear();
    let images: std::collections::HashSet<_> =
        shown.iter().map(|reader_case| &reader_case.image).collect();
    let exported = Exported {
        pages,
        key,
        pictures: shown.len(),
        repeats: shown.len() - images.len(),
        bytes: size,
    };
    output.print(&exported, |done| {
        format!(
            "{}: {} with {}, {} of them repeats ({})\nkeep the key to yourself: {}",
            args.out.display(),
            count(done.pages.len(), "page"),
            count(done.pictures, "picture"),
            done.repeats,
            bytes(done.bytes),
            done.key.display()
        )
    })
}

fn beside(folder: &Path) -> PathBuf {
    // `out/` and `out` are the same folder.
    let mut name = folder.components().as_path().as_os_str().to_owned();
    name.push(".key.csv");
    name.into()
}

/// `grading.html`, or `grading_01.html` and so on.
fn pages(folder: &Path, pictures: usize) -> Vec<PathBuf> {
    match pictures.div_ceil(PICTURES_PER_PAGE) {
        0 | 1 => vec![folder.join("grading.html")],
        of => (1..=of)
            .map(|n| folder.join(format!("grading_{n:02}.html")))
            .collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// With as many pictures as the paper's dataset has radiographs and repeats.
    #[test]
    fn many_pictures_are_parted_into_pages() {
        let names = |pictures| pages(Path::new("out"), pictures);
        assert_eq!(names(PICTURES_PER_PAGE), [Path::new("out/grading.html")]);
        let many = names(3077 + 308);
        assert_eq!(many.len(), 17);
        assert_eq!(many[0], Path::new("out/grading_01.html"));
        assert_eq!(many[16], Path::new("out/grading_17.html"));
    }
}
