//! `ppa depth camera`: a camera JSON from the calibration file of a device.

use std::path::PathBuf;

use anyhow::Context;
use clap::{Args, ValueEnum};
use ppa_dataset::write_whole;
use ppa_depth::{Camera, CameraSpec, DepthMode};

use crate::output::Output;
use crate::output_files::ReplaceArgs;

#[derive(Debug, Args)]
pub struct CameraArgs {
    /// Raw calibration JSON of an Azure Kinect or Orbbec camera, Orbbec parameters as JSON (read by the field names of the SDK, not tested
    /// with a file from a device), OpenCV YAML, or a camera JSON [default: an Azure Kinect]
    calibration: Option<PathBuf>,
    /// Depth mode; used for raw calibrations, which describe the whole sensor
    #[arg(long, value_enum, default_value_t = Mode::NfovUnbinned)]
    mode: Mode,
    /// Mask directions that the mode's illumination does not reach: outside a hexagon (narrow) or a circle (wide)
    #[arg(long)]
    mask: bool,
    /// Camera JSON to write
    #[arg(long)]
    out: PathBuf,
    #[command(flatten)]
    replace: ReplaceArgs,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Mode {
    NfovUnbinned,
    NfovBinned,
    WfovUnbinned,
    WfovBinned,
}

impl From<Mode> for DepthMode {
    fn from(mode: Mode) -> Self {
        match mode {
            Mode::NfovUnbinned => Self::NfovUnbinned,
            Mode::NfovBinned => Self::NfovBinned,
            Mode::WfovUnbinned => Self::WfovUnbinned,
            Mode::WfovBinned => Self::WfovBinned,
        }
    }
}

pub fn run(args: &CameraArgs, output: Output) -> anyhow::Result<()> {
    let mut outputs = args.replace.outputs();
    outputs.file_in_new_folder("--out", &args.out, &[".json"])?;
    let mode = args.mode.into();
    let mut spec = match &args.calibration {
        Some(path) => CameraSpec::import(path, mode)?,
        None => CameraSpec::azure_kinect(mode),
    };
    if args.mask {
        spec.mask = Some(mode.mask());
    }
    let check = Camera::try_from(spec.clone());
    check.with_context(|| match &args.calibration {
        Some(path) => path.display().to_string(),
        None => "the built-in camera".to_owned(),
    })?;
    let mut json = serde_json::to_vec_pretty(&spec)?;
    json.push(b'\n');
    write_whole(&args.out, &json)?;
    output.print(&spec, |spec| {
        format!(
            "{}: {} x {} pixels, focal length {:.1}",
            args.out.display(),
            spec.width,
            spec.height,
            spec.fx
        )
    })
}
