//! `ppa dataset convert`: converts one published layout to the other.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use ppa_core::text::count;
use ppa_dataset::published::{Flexion, Layout, Published, convert};

use crate::interrupt::{Interrupt, NOTHING_WRITTEN};
use crate::output::{Output, working};
use crate::output_files::OutputFiles;

#[derive(Debug, Args)]
#[command(after_long_help = "\
Synthetic to specimen: the step becomes the image number, the body shape the time stamp (0 orig, 1 big, 2 small, 3 bumps_a, \
4 bumps_b), and all poses get the flexion --flexion, since a scan does not show it.

Specimen to synthetic: the poses of --flexion; the number of an image becomes its step, so that the angle in a file's name is only \
half that number. The earliest image of a pose becomes orig; what is left out is counted.")]
pub struct ConvertArgs {
    /// Dataset in either layout
    dataset: PathBuf,
    /// Folder of the new dataset, which must not exist
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Which flexion to write, or to read
    #[arg(long, value_enum, default_value = "medium")]
    flexion: FlexionName,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum FlexionName {
    Min,
    Medium,
    Max,
}

pub fn run(args: &ConvertArgs, output: Output) -> anyhow::Result<()> {
    OutputFiles::new().folder("--out", &args.out)?;
    let from = Published::read(&args.dataset)?;
    let flexion = match args.flexion {
        FlexionName::Min => Flexion::Min,
        FlexionName::Medium => Flexion::Medium,
        FlexionName::Max => Flexion::Max,
    };
    let working = working("copying images");
    let interrupt = Interrupt::listen()?;
    let done = convert(&from, &args.out, flexion, interrupt.flag());
    let done = interrupt.or_how(done, || NOTHING_WRITTEN.to_owned())?;
    working.finish_and_clear();
    output.print(&done, |done| {
        let layout = match from.layout {
            Layout::Synthetic => "specimen",
            Layout::Specimen => "synthetic",
        };
        format!(
            "{}: {}, {} and {} in the {layout} layout; left out: {}, {}, {}",
            args.out.display(),
            count(done.depth_images, "depth image"),
            count(done.radiographs, "radiograph"),
            count(done.labels, "label"),
            count(done.left_out, "depth image"),
            count(done.radiographs_left_out, "radiograph"),
            count(done.labels_left_out, "label")
        )
    })
}
