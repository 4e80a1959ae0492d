//! Limits on the share of an image cut off by the field of view.

use std::fmt;

use ppa_dataset::layout::{LimbId, View, angle_text};

/// Largest share of a region that may be cut unless the plan says otherwise; above it, the pose has a finding.
pub(crate) const MAX_CUT_SHARE: f64 = 0.01;

/// An image of a pose.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PoseImage {
    /// Depth image of the skin of the scan.
    Depth(View),
    /// Radiograph.
    Radiograph,
}

impl PoseImage {
    /// Key of the plan that limits how much of it may be cut.
    fn key(self) -> &'static str {
        match self {
            Self::Depth(_) => "depth.max_cut_share",
            Self::Radiograph => "xray.max_cut_share",
        }
    }
}

impl fmt::Display for PoseImage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Depth(View::Left) => "left camera's region of interest",
            Self::Depth(View::Right) => "right camera's region of interest",
            Self::Radiograph => "radiograph's region",
        })
    }
}

/// A region of which more is cut than the plan allows; the worst of a limb.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error(
    "limb {} of patient {} at {} degrees: {:.1} % of the {image} lies where the field of view of the scan cuts the limb off, but {} allows \
     {:.1} % ({exceeding} of {poses} poses exceed it); raise {} in the plan, take another camera or other rotations, or a scan \
     that shows more of the limb",
    limb.side_letter(), limb.patient, angle_text(*step), 100.0 * share, image.key(), 100.0 * limit, image.key()
)]
pub struct CutError {
    /// The limb.
    pub limb: LimbId,
    /// Half degrees of medial rotation.
    pub step: u32,
    /// The image.
    pub image: PoseImage,
    /// Share of its region, 0 to 1.
    pub share: f64,
    /// Largest share that the plan allows.
    pub limit: f64,
    /// Poses of which such a share is larger than the plan allows.
    pub exceeding: usize,
    /// Poses of the limb.
    pub poses: usize,
}
