//! Writing a volume in the format implied by a name.

use std::path::Path;

use crate::error::WriteError;
use crate::scan::Scan;
use crate::volume::Volume;

/// Writes a volume: NIfTI (`.nii`, `.nii.gz`), NRRD (`.nrrd`), MetaImage (`.mha`, `.mhd` and a `.zraw`), or a
/// folder of DICOM slices, which is a name without an extension, one that ends in a slash, or an empty folder.
///
/// ```
/// use nalgebra::{Point3, Vector3};
/// use ppa_ct::{Grid, Volume, read, write};
/// let grid = Grid::axis_aligned([4, 3, 2], Vector3::new(0.5, 0.5, 2.0), Point3::new(-80.0, 10.0, 5.0))?;
/// let volume = Volume::new(grid, (0..24).map(|n| 100.0 * n as f32 - 1000.0).collect())?;
/// let folder = tempfile::tempdir()?;
/// for name in ["leg.nii.gz", "leg.nrrd", "leg.mha", "leg.mhd", "leg"] {
///     let path = folder.path().join(name);
///     write(&path, &volume)?;
///     assert_eq!(read(&path)?.volume, volume);
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`WriteError`] of the format, or for other extensions.
pub fn write(path: &Path, volume: &Volume) -> Result<(), WriteError> {
    match Format::of_name(path)? {
        Format::Dicom => write_dicom(path, volume),
        Format::Nifti => write_nifti(path, volume),
        Format::Nrrd => write_nrrd(path, volume),
        Format::MetaImage => write_meta_image(path, volume),
    }
}

/// A format that can be written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Format {
    /// A folder with a DICOM CT series.
    Dicom,
    /// NIfTI-1.
    Nifti,
    /// NRRD.
    Nrrd,
    /// MetaImage.
    MetaImage,
}

impl Format {
    /// Returns the format in which [`write()`] writes to this name.
    ///
    /// # Errors
    /// [`WriteError::Extension`] for extensions other than those of [`write()`].
    pub fn of_name(path: &Path) -> Result<Self, WriteError> {
        let slash = path.as_os_str().as_encoded_bytes().ends_with(b"/");
        if slash || path.is_dir() || path.extension().is_none() {
            return Ok(Self::Dicom);
        }
        let extension = path.extension().unwrap_or_default().to_string_lossy();
        match extension.to_ascii_lowercase().as_str() {
            "nii" | "gz" => Ok(Self::Nifti),
            "nrrd" => Ok(Self::Nrrd),
            "mha" | "mhd" => Ok(Self::MetaImage),
            _ => Err(WriteError::Extension {
                path: path.to_owned(),
                expected: "a name ending in .nii, .nii.gz, .nrrd, .mha or .mhd, or a folder for DICOM slices",
            }),
        }
    }
}

impl Scan {
    /// Writes the volume as [`write()`] does, but refuses to write a DICOM CT if the source says that it is something else.
    ///
    /// # Errors
    /// The same as [`write()`]; [`WriteError::NotCt`] if a DICOM CT is asked for, and the scan is of another modality or
    /// its values are in another unit than HU.
    pub fn write(&self, path: &Path) -> Result<(), WriteError> {
        let modality = self.modality.as_deref().filter(|m| *m != "CT");
        let found = match (modality, self.acquisition.unit) {
            (Some(modality), _) => format!("modality {modality}"),
            (None, Some(unit)) => format!("values in {unit}"),
            (None, None) => return write(path, &self.volume),
        };
        match Format::of_name(path)? {
            Format::Dicom => Err(WriteError::NotCt {
                path: path.to_owned(),
                found,
            }),
            _ => write(path, &self.volume),
        }
    }
}

#[cfg(feature = "dicom")]
use crate::dicom_write::write as write_dicom;
#[cfg(feature = "metaimage")]
use crate::meta_image::write as write_meta_image;
#[cfg(feature = "nifti")]
use crate::nifti_file::write as write_nifti;
#[cfg(feature = "nrrd")]
use crate::nrrd_file::write as write_nrrd;

#[cfg(not(feature = "dicom"))]
fn write_dicom(path: &Path, _: &Volume) -> Result<(), WriteError> {
    feature_off(path, "dicom")
}

#[cfg(not(feature = "nifti"))]
fn write_nifti(path: &Path, _: &Volume) -> Result<(), WriteError> {
    feature_off(path, "nifti")
}

#[cfg(not(feature = "nrrd"))]
fn write_nrrd(path: &Path, _: &Volume) -> Result<(), WriteError> {
    feature_off(path, "nrrd")
}

#[cfg(not(feature = "metaimage"))]
fn write_meta_image(path: &Path, _: &Volume) -> Result<(), WriteError> {
    feature_off(path, "metaimage")
}

#[cfg(not(all(
    feature = "dicom",
    feature = "nifti",
    feature = "nrrd",
    feature = "metaimage"
)))]
fn feature_off(path: &Path, feature: &'static str) -> Result<(), WriteError> {
    Err(WriteError::FeatureOff {
        path: path.to_owned(),
        feature,
    })
}
