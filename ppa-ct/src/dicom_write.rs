//! A volume as a folder of DICOM CT images, one file per slice.

mod ct_image;
mod decimal;
mod rescale;
mod uid;

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::Path;

use rayon::prelude::*;

use crate::error::WriteError;
use crate::volume::Volume;
use ct_image::CtSeries;

/// Writes a volume as a folder of DICOM CT images: `slice_0001.dcm` for k = 0, and so on.
///
/// Explicit VR little endian, 16 bit signed. Whole numbers that fit are stored as they are
/// (slope 1, intercept 0). Others are rounded to the nearest of 65535 levels from the smallest to
/// the largest value, so a value is off by at most (largest - smallest) / 131068. Positions are decimal strings of 16 characters. A gantry tilt is
/// kept: each slice has its own position.
/// A left-handed lattice is written too; readers that sort by position, as ours does, return it
/// with k reversed and every voxel at its position.
///
/// Nothing is known about the patient, so nothing is stated. UIDs are derived from the voxels and their positions, so that equal volumes
/// give equal bytes.
///
/// The folder must not exist yet, or be empty; it is written completely or not at all.
///
/// # Errors
/// [`WriteError`] for axes i and j more than 0.28 degrees from perpendicular, which readers refuse too, more than 65535 voxels along an
/// axis, a folder that is not empty, and failures of the file system.
pub fn write(folder: &Path, volume: &Volume) -> Result<(), WriteError> {
    let series = CtSeries::of(volume)?;
    let exists = || WriteError::Exists {
        path: folder.to_owned(),
    };
    let taken = folder.exists();
    if taken && fs::read_dir(folder).map_or(true, |mut files| files.next().is_some()) {
        return Err(exists());
    }
    let io = |source| WriteError::Io {
        path: folder.to_owned(),
        source,
    };
    let parent = match folder.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    let temporary = tempfile::Builder::new()
        .prefix(".ppa-ct-")
        .tempdir_in(parent)
        .map_err(io)?;
    // A subfolder, since the temporary folder itself is closed to other users.
    let slices = temporary.path().join("slices");
    fs::create_dir(&slices).map_err(io)?;
    let [_, _, nz] = volume.grid().size();
    (0..nz).into_par_iter().try_for_each(|k| {
        let name = format!("slice_{:04}.dcm", k + 1);
        let object = series.slice(k).map_err(|source| WriteError::Encode {
            path: folder.join(&name),
            source,
        })?;
        let write = || -> Result<(), Box<dyn std::error::Error + Send + Sync>> {
            let mut file = BufWriter::new(File::create(slices.join(&name))?);
            object.write_all(&mut file)?;
            file.flush()?;
            Ok(())
        };
        write().map_err(|source| match source.downcast::<io::Error>() {
            Ok(source) => io(*source),
            Err(source) => WriteError::Encode {
                path: folder.join(&name),
                source,
            },
        })
    })?;
    if taken {
        // The folder may have been filled meanwhile.
        fs::remove_dir(folder).map_err(|_| exists())?;
    }
    fs::rename(&slices, folder).map_err(io)
}
