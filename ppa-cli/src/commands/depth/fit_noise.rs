//! `ppa depth fit-noise`: fits a sensor model to the noise of a recording.

use std::path::{Path, PathBuf};

use anyhow::Context;
use clap::Args;
use ppa_core::text::count;
use ppa_dataset::write_whole;
use ppa_depth::{DepthImage, Invalidation, SensorSpec, fit_noise};

use crate::output::Output;
use crate::output_files::ReplaceArgs;

#[derive(Debug, Args)]
pub struct FitNoiseArgs {
    /// Folder with the frames of a static scene, 16-bit PNG in mm, 0 invalid
    frames: PathBuf,
    /// Camera JSON [default: an Azure Kinect, 640 x 576]
    #[arg(long)]
    camera: Option<PathBuf>,
    /// Sensor JSON to write: the random error as fitted, the other parts as in the default sensor
    #[arg(long)]
    out: PathBuf,
    #[command(flatten)]
    replace: ReplaceArgs,
}

pub fn run(args: &FitNoiseArgs, output: Output) -> anyhow::Result<()> {
    let mut outputs = args.replace.outputs();
    outputs.file_in_new_folder("--out", &args.out, &[".json"])?;
    let camera = super::read_camera(args.camera.as_ref())?;
    let frames = read_frames(&args.frames)?;
    let fit = fit_noise(&camera, &frames, true)
        .with_context(|| format!("frames in {}", args.frames.display()))?;
    let default = SensorSpec::default();
    let sensor = SensorSpec {
        random: Some(fit.random),
        invalid: default.invalid.map(|invalid| Invalidation {
            min_signal: fit.min_signal.unwrap_or(0.0),
            ..invalid
        }),
        ..default
    };
    let mut json = serde_json::to_vec_pretty(&sensor)?;
    json.push(b'\n');
    write_whole(&args.out, &json)?;
    output.print(&fit, |fit| {
        format!(
            "{}: {}, {}: {:.2} mm at unit signal, {:.2} mm floor; misfit {:.0} %; other parts are not \
             from the recording",
            args.out.display(),
            count(fit.frames, "frame"),
            count(fit.pixels, "pixel"),
            fit.random.at_unit_signal_mm,
            fit.random.floor_mm,
            100.0 * fit.relative_misfit
        )
    })
}

/// Reads all PNGs of a folder, sorted by name.
fn read_frames(folder: &Path) -> anyhow::Result<Vec<DepthImage>> {
    let unreadable = || format!("cannot read {}", folder.display());
    let mut paths = std::fs::read_dir(folder)
        .with_context(unreadable)?
        .map(|entry| entry.map(|entry| entry.path()))
        .collect::<Result<Vec<_>, _>>()
        .with_context(unreadable)?;
    paths.retain(|path| {
        path.extension()
            .is_some_and(|ext| ext.eq_ignore_ascii_case("png"))
    });
    paths.sort_unstable();
    let frames = paths.iter().map(|path| DepthImage::read_png(path));
    Ok(frames.collect::<Result<_, _>>()?)
}
