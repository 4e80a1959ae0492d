//! CT volumes in Hounsfield units with a typed voxel-to-world affine.
//!
//! [`read`] reads a DICOM series or a NIfTI, NRRD or MetaImage file as a [`Scan`] with a
//! [`Volume`], or reports why it cannot; [`write()`] writes one; [`Info`] lists its properties and [`audit`] checks whether it is a
//! plausible CT.
//! A [`Volume`] is cropped, resampled ([`Volume::resampled`]) and set upright ([`Volume::upright`]).
//!
//! Units: mm, Hounsfield units. Frames: `voxel` (i, j, k; the centre of the first voxel is
//! (0, 0, 0)) and `ct` (DICOM patient axes LPS: x to the left, y posterior, z superior).
//! A volume may be sheared (gantry tilt) or left-handed: its affine stays as acquired.
//! No name of a person or place and no date passes from a file into these types.
//!
//! Features (all on by default): `dicom`, `nifti`, `nrrd` and `metaimage` enable the readers and writers, `audit` the findings about a scan. Without
//! them the crate is geometry only.
//!
//! ```
//! use nalgebra::{Point3, Vector3};
//! use ppa_ct::{Grid, Volume};
//! let grid = Grid::axis_aligned([2, 2, 3], Vector3::new(1.0, 1.0, 2.5), Point3::origin())?;
//! let volume = Volume::new(grid, vec![40.0; 12])?;
//! assert_eq!(volume.sample(&Point3::new(0.5, 0.5, 2.5)), Some(40.0));
//! # Ok::<(), ppa_ct::VolumeError>(())
//! ```

mod acquisition;
#[cfg(feature = "audit")]
pub mod audit;
mod compiled_with;
mod derived_grids;
#[cfg(feature = "dicom")]
mod dicom_series;
#[cfg(feature = "dicom")]
mod dicom_write;
mod error;
mod grid;
mod identity;
mod info;
mod low_pass;
mod lps_view;
#[cfg(feature = "metaimage")]
mod meta_image;
#[cfg(feature = "nifti")]
mod nifti_file;
#[cfg(feature = "nrrd")]
mod nrrd_file;
mod read;
mod refine;
mod resample;
mod scan;
#[cfg(any(feature = "nifti", feature = "nrrd", feature = "metaimage"))]
#[cfg_attr(
    not(all(feature = "nifti", feature = "nrrd", feature = "metaimage")),
    allow(
        dead_code,
        reason = "shared by three formats, each of which needs a part"
    )
)]
mod scan_file;
#[cfg(any(feature = "nifti", feature = "nrrd", feature = "metaimage"))]
#[cfg_attr(
    not(all(feature = "nifti", feature = "nrrd", feature = "metaimage")),
    allow(
        dead_code,
        reason = "shared by three formats, each of which needs a part"
    )
)]
mod stored;
mod values;
mod volume;
mod volume_error;
mod write;

pub use acquisition::Acquisition;
pub use compiled_with::compiled_with;
#[cfg(feature = "dicom")]
pub use dicom_write::write as write_dicom;
pub use error::{Gap, ReadError, WriteError};
pub use grid::{Grid, GridError};
pub use info::Info;
pub use lps_view::LpsView;
#[cfg(feature = "metaimage")]
pub use meta_image::write as write_meta_image;
#[cfg(feature = "nifti")]
pub use nifti_file::write as write_nifti;
#[cfg(feature = "nrrd")]
pub use nrrd_file::write as write_nrrd;
pub use read::{read, read_with};
pub use resample::Interpolation;
pub use scan::{ReadOptions, Scan, SeriesChoice, SeriesSummary, Warning, WarningCode};
pub use values::{Values, with_room};
pub use volume::Volume;
pub use volume_error::VolumeError;
pub use write::{Format, write};
