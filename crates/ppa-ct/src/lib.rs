//! CT volumes in Hounsfield units with a typed voxel-to-world affine.
//!
//! Units: mm, Hounsfield units. Frames: `voxel` (i, j, k; the centre of the first voxel is
//! (0, 0, 0)) and `ct` (DICOM patient axes LPS: x to the left, y posterior, z superior).

mod grid;
pub mod phantom;
mod volume;

pub use grid::{Grid, GridError};
pub use volume::{Volume, VolumeError};
