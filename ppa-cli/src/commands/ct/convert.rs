//! `ppa ct convert`: converts a CT between supported formats.

use std::path::PathBuf;

use anyhow::{Context, anyhow};
use clap::Args;
use nalgebra::{Point3, Vector3};
use ppa_ct::{Info, Interpolation, Volume, VolumeError, WarningCode, read};
use ppa_mesh::VoxelBox;

use crate::interrupt::{NOTHING_WRITTEN, ends_at_once};
use crate::number_lists::{along_axes, voxel_box, world_box};
use crate::output::{Output, working};
use crate::output_files::ReplaceArgs;
use crate::scan_args::ScanArgs;

/// Value outside a tilted stack that was made upright.
const AIR_HU: f32 = -1000.0;

#[derive(Debug, Args)]
#[command(after_long_help = "\
Voxels stay as they are unless a change is asked for. Changes are made in the order of the options above; values \
between voxels are interpolated linearly, after a low-pass along axes that become coarser.

  ppa ct convert scans/leg leg.nrrd                  # the same voxels
  ppa ct convert scans/head head.nii.gz --upright    # a tilted gantry
  ppa ct convert leg.nrrd foot.mha --spacing-mm 1 \\
      --crop-mm=-60,60,-90,150,-400,-250")]
pub struct ConvertArgs {
    #[command(flatten)]
    input: ScanArgs,
    /// File to write: .nii, .nii.gz, .nrrd, .mha, .mhd, or a new folder for DICOM slices
    output: PathBuf,
    /// Keep only this box of the scan's voxels: first and one past the last index along i, j and k
    #[arg(long, value_name = "I,I,J,J,K,K", value_parser = voxel_box)]
    crop: Option<VoxelBox>,
    /// Shift the slices of a tilted-gantry scan onto a rectangular grid; corners become air
    #[arg(long)]
    upright: bool,
    /// Keep only the voxels whose centres lie in this box: from and to along x, y and z, LPS
    #[arg(long, value_name = "X,X,Y,Y,Z,Z", value_parser = world_box, allow_hyphen_values = true)]
    crop_mm: Option<[[f64; 3]; 2]>,
    /// Voxel spacing to resample to: one number, or three for i, j and k
    #[arg(long, value_name = "MM", value_parser = along_axes, allow_hyphen_values = true)]
    spacing_mm: Option<[f64; 3]>,
    #[command(flatten)]
    replace: ReplaceArgs,
}

impl ConvertArgs {
    fn changed(&self, mut volume: Volume) -> anyhow::Result<Volume> {
        if let Some(VoxelBox { low, high }) = self.crop {
            let [nx, ny, nz] = volume.grid().size();
            volume = volume.crop(low, high).map_err(|error| match error {
                VolumeError::Memory { .. } => error.into(),
                _ => anyhow!("--crop is not a box inside the scan's {nx} x {ny} x {nz} voxels"),
            })?;
        }
        if self.upright {
            volume = volume
                .upright(Interpolation::Linear, AIR_HU)
                .context("--upright")?;
        }
        if let Some([min, max]) = self.crop_mm {
            volume = volume
                .crop_world(&Point3::from(min), &Point3::from(max))
                .map_err(|error| match error {
                    VolumeError::Memory { .. } => error.into(),
                    _ => anyhow!("the box of --crop-mm contains no voxel centre"),
                })?;
        }
        if let Some(spacing) = self.spacing_mm {
            volume = volume
                .resampled(Vector3::from(spacing), Interpolation::Linear)
                .context("--spacing-mm")?;
        }
        Ok(volume)
    }
}

pub fn run(args: &ConvertArgs, output: Output) -> anyhow::Result<()> {
    args.replace.outputs().volume("OUTPUT", &args.output)?;
    let stoppable = ends_at_once(NOTHING_WRITTEN)?;
    let _working = working("converting");
    let mut source = args.input.read()?;
    source.volume = args.changed(source.volume)?;
    drop(stoppable);
    source.write(&args.output)?;
    // Read back from the file, so that the output shows what other readers will find.
    let mut info = Info::of(&read(&args.output)?);
    // Warnings that the file cannot show about the original scan; it does show a tilt.
    let lost = source.warnings.into_iter().filter(|warning| {
        let report = info.warnings.iter().any(|w| w.code == warning.code);
        !report && warning.code != WarningCode::GantryTilt
    });
    info.warnings.extend(lost.collect::<Vec<_>>());
    output.print(&info, super::describe)
}
