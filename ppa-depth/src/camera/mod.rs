//! Camera model of a Time-of-Flight device: calibration files, lens distortion, pose, rig.

pub(crate) mod calibration_file;
pub(crate) mod depth_mode;
pub(crate) mod distortion;
pub(crate) mod field_mask;
pub(crate) mod opencv_yaml;
pub(crate) mod optics;
pub(crate) mod projection;
pub(crate) mod rig;
pub(crate) mod rigid;
pub(crate) mod spec;
pub(crate) mod viewpoint;
