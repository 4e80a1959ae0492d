//! Why a volume could not be written.

use std::path::PathBuf;

use super::Cause;

/// Why a volume could not be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WriteError {
    /// The name does not belong to a format that can be written.
    #[error("cannot write {}: expected {expected}", path.display())]
    Extension {
        /// The name given.
        path: PathBuf,
        /// Names that are supported.
        expected: &'static str,
    },
    /// A name that the header of the format cannot hold.
    #[error("cannot write {}: expected a name {expected}", path.display())]
    Name {
        /// The name given.
        path: PathBuf,
        /// Names that the format supports.
        expected: &'static str,
    },
    /// A DICOM CT was asked for, but the source says that the scan is not a CT.
    #[error("{} would be a DICOM CT in Hounsfield units, but the scan holds {found}: write NIfTI, NRRD or MetaImage", path.display())]
    NotCt {
        /// The folder asked for.
        path: PathBuf,
        /// Modality or unit.
        found: String,
    },
    /// The crate was built without this writer.
    #[error("{} needs the feature `{feature}` of ppa-ct, which this build lacks", path.display())]
    FeatureOff {
        /// The file or folder.
        path: PathBuf,
        /// Cargo feature that holds the writer.
        feature: &'static str,
    },
    /// More voxels along one axis than the format can hold.
    #[error("a volume of {} x {} x {} voxels does not fit in {format}, which allows at most {most} along each axis", size[0], size[1], size[2])]
    TooLarge {
        /// Voxels along i, j, k.
        size: [usize; 3],
        /// The format.
        format: &'static str,
        /// Largest number of voxels along an axis.
        most: usize,
    },
    /// The axes i and j are not perpendicular, as a DICOM slice requires.
    #[error(
        "the axes i and j deviate by {lean_deg:.3} degrees from perpendicular, which a DICOM slice cannot represent"
    )]
    SlantedSlices {
        /// Deviation from perpendicular.
        lean_deg: f64,
    },
    /// The folder to be written is not empty.
    #[error("{} exists and is not an empty folder; nothing was written", path.display())]
    Exists {
        /// The folder asked for.
        path: PathBuf,
    },
    /// An object could not be encoded.
    #[error("cannot encode {}", path.display())]
    Encode {
        /// The file asked for.
        path: PathBuf,
        /// The cause.
        source: Cause,
    },
    /// The file could not be written; nothing is left behind.
    #[error("cannot write {}", path.display())]
    Io {
        /// The file asked for.
        path: PathBuf,
        /// The cause.
        source: std::io::Error,
    },
}
