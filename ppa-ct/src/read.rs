//! Choice of the reader for a file or folder.

use std::path::{Path, PathBuf};

use crate::error::ReadError;
use crate::scan::{ReadOptions, Scan, starts_as_dicom};

/// Reads a CT: a folder with one DICOM series, a single DICOM file, a DICOMDIR, NIfTI (`.nii`, `.nii.gz`),
/// NRRD (`.nrrd`, `.nhdr`) or MetaImage (`.mha`, `.mhd`).
///
/// The same as [`read_with`] with default options.
///
/// # Errors
/// The same as [`read_with`].
pub fn read(path: &Path) -> Result<Scan, ReadError> {
    read_with(path, &ReadOptions::default())
}

/// Reads a CT with options.
///
/// DICOM slices are sorted by their position along the slice normal; names and instance numbers
/// are ignored. Subfolders are searched when the folder itself has no DICOM image. A tilted gantry
/// gives a sheared affine, exactly as acquired. Padding becomes air.
///
/// # Errors
/// [`ReadError`]: other formats, modalities other than CT, several series, missing slices,
/// slices at the same position, mixed geometry, damaged files, pixel encodings without a decoder.
pub fn read_with(path: &Path, options: &ReadOptions) -> Result<Scan, ReadError> {
    let io = |source| ReadError::Io {
        path: path.to_owned(),
        source,
    };
    if std::fs::metadata(path).map_err(io)?.is_dir() {
        return read_dicom_folder(path, options).map_err(|error| match error {
            ReadError::NoDicom { path, files, .. } => ReadError::NoDicom {
                volume: volume_in(&path),
                path,
                files,
            },
            error => error,
        });
    }
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let name = name.to_ascii_lowercase();
    if name.ends_with(".dcm") || starts_as_dicom(path).map_err(io)? {
        return read_dicom_file(path, options);
    }
    if options.series.is_some() {
        return Err(ReadError::NoSuchSeries {
            path: path.to_owned(),
            series: Vec::new(),
        });
    }
    match Format::of_name(&name) {
        Some(Format::Nifti) => read_nifti(path),
        Some(Format::Nrrd) => read_nrrd(path),
        Some(Format::MetaImage) => read_meta_image(path, options.force),
        None => Err(ReadError::Unsupported {
            path: path.to_owned(),
        }),
    }
}

/// Formats recognised by file name.
enum Format {
    Nifti,
    Nrrd,
    MetaImage,
}

impl Format {
    /// Returns the format of a file with this lower-case name.
    fn of_name(name: &str) -> Option<Self> {
        let ends_with = |endings: &[&str]| endings.iter().any(|ending| name.ends_with(ending));
        if ends_with(&[".nii", ".nii.gz"]) {
            Some(Self::Nifti)
        } else if ends_with(&[".nrrd", ".nhdr"]) {
            Some(Self::Nrrd)
        } else if ends_with(&[".mha", ".mhd"]) {
            Some(Self::MetaImage)
        } else {
            None
        }
    }
}

/// The first file of a folder, by name, whose name has another format than DICOM.
fn volume_in(folder: &Path) -> Option<PathBuf> {
    let entries = std::fs::read_dir(folder).ok()?;
    let paths = entries.filter_map(|entry| Some(entry.ok()?.path()));
    let is_volume = |path: &PathBuf| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        path.is_file() && Format::of_name(&name.to_ascii_lowercase()).is_some()
    };
    paths.filter(is_volume).min()
}

#[cfg(feature = "dicom")]
use crate::dicom_series::{read_file as read_dicom_file, read_folder as read_dicom_folder};

#[cfg(feature = "nifti")]
use crate::nifti_file::read as read_nifti;

#[cfg(feature = "nrrd")]
use crate::nrrd_file::read as read_nrrd;

#[cfg(feature = "metaimage")]
use crate::meta_image::read as read_meta_image;

#[cfg(not(feature = "dicom"))]
fn read_dicom_folder(path: &Path, _: &ReadOptions) -> Result<Scan, ReadError> {
    feature_off(path, "dicom")
}

#[cfg(not(feature = "dicom"))]
fn read_dicom_file(path: &Path, _: &ReadOptions) -> Result<Scan, ReadError> {
    feature_off(path, "dicom")
}

#[cfg(not(feature = "nifti"))]
fn read_nifti(path: &Path) -> Result<Scan, ReadError> {
    feature_off(path, "nifti")
}

#[cfg(not(feature = "nrrd"))]
fn read_nrrd(path: &Path) -> Result<Scan, ReadError> {
    feature_off(path, "nrrd")
}

#[cfg(not(feature = "metaimage"))]
fn read_meta_image(path: &Path, _: bool) -> Result<Scan, ReadError> {
    feature_off(path, "metaimage")
}

#[cfg(not(all(
    feature = "dicom",
    feature = "nifti",
    feature = "nrrd",
    feature = "metaimage"
)))]
fn feature_off(path: &Path, feature: &'static str) -> Result<Scan, ReadError> {
    Err(ReadError::FeatureOff {
        path: path.to_owned(),
        feature,
    })
}
