//! Files of depth images: 16-bit PNG, OpenEXR, points, previews in colour.

pub(crate) mod exr_file;
pub(crate) mod png_file;
pub(crate) mod points_file;
pub(crate) mod preview;
