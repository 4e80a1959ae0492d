//! `ppa calibrate`: calibrates the prediction intervals of trained networks.

use std::path::PathBuf;

use clap::Args;
use ppa_core::text::count;
use ppa_dataset::labels::LabelName;
use ppa_learn::DeviceName;
use ppa_learn::frames::{Calibration, Confidence};
use ppa_learn::train::Source;

use crate::findings::repeat_of_datasets;
use crate::interrupt::{NOTHING_WRITTEN, ends_at_once};
use crate::output::{Output, working};
use crate::output_files::ReplaceArgs;

#[derive(Debug, Args)]
#[command(
    after_help = "The networks must not have been trained with any of these persons, and the dataset must have images of both cameras. Intervals come from the absolute errors of their poses (split conformal prediction): \
for a new person, they contain the label of a pose with a probability of about the coverage. `ppa predict` refuses a frame whose network features or mean depths of 8 x 8 blocks lie farther from \
those of training images than 99 % of the calibration images' do."
)]
pub struct CalibrateArgs {
    /// Folder of the finished `ppa train` of the left camera's network
    left: PathBuf,
    /// Folder of the right camera's network [default: LEFT is used for both cameras; its views must be "unified" or "pairs"]
    right: Option<PathBuf>,
    /// Dataset with the persons to calibrate with
    #[arg(long, value_name = "DIR")]
    dataset: PathBuf,
    /// Persons of --dataset [default: all]
    #[arg(long, value_name = "N,...", value_delimiter = ',')]
    patients: Option<Vec<u32>>,
    /// Label set of --dataset: labels.NAME.json [default: labels.json]
    #[arg(long, value_name = "NAME")]
    labels: Option<LabelName>,
    /// Probability that an interval contains the label
    #[arg(long, value_name = "SHARE", default_value_t = 0.9)]
    coverage: f64,
    /// Device to run the networks on: cpu, cuda or cuda:N
    #[arg(long, default_value_t)]
    device: DeviceName,
    /// File for `ppa predict --confidence`, in safetensors
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    #[command(flatten)]
    replace: ReplaceArgs,
}

pub fn run(args: &CalibrateArgs, output: Output) -> anyhow::Result<()> {
    let mut outputs = args.replace.outputs();
    outputs.file("--out", &args.out, &[".safetensors"])?;
    let stoppable = ends_at_once(NOTHING_WRITTEN)?;
    repeat_of_datasets(std::iter::once(&*args.dataset))?;
    let sources = [Source {
        dataset: args.dataset.clone(),
        patients: args.patients.clone(),
        shapes: None,
        every_pose: None,
        labels: args.labels.clone(),
    }];
    let spinner = working("calibrating");
    let (left, right) = (&args.left, args.right.as_deref());
    let (confidence, calibration) =
        Confidence::calibrate(left, right, &sources, args.coverage, args.device)?;
    spinner.finish_and_clear();
    drop(stoppable);
    confidence.write(&args.out)?;
    output.print(&calibration, describe)
}

fn describe(calibration: &Calibration) -> String {
    let Calibration {
        persons,
        pairs,
        intervals,
        coverage_of_left_out_persons,
    } = calibration;
    let percent = |share: f64| format!("{:.1} %", 100.0 * share);
    let mut lines = vec![format!(
        "{} of {}; intervals that contain the label with {} probability:",
        count(*pairs, "pair"),
        count(*persons, "person"),
        percent(intervals.coverage),
    )];
    for bin in &intervals.bins {
        lines.push(format!(
            "  predictions to {:.2}: +- {:.2} ({})",
            bin.to,
            bin.half_width,
            count(bin.poses, "pair")
        ));
    }
    lines.push(match coverage_of_left_out_persons {
        Some(share) => format!(
            "Each person's labels in intervals calibrated on the other persons: {}",
            percent(*share)
        ),
        None => "Too few persons to test the intervals on persons left out.".to_owned(),
    });
    lines.join("\n")
}
