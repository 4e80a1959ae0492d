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
    /// Key of the plan that limits how much of the image may be cut.
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

/// More of a region is cut than the plan allows.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error(
    "limb {} of patient {}: the field of view of the scan cuts off {}; raise the limit in the plan, use another camera, \
     other rotations, or a scan that shows more of the limb",
    limb.side_letter(), limb.patient, listed(worst)
)]
pub struct CutError {
    /// The limb.
    pub limb: LimbId,
    /// The worst region of each limit that is exceeded.
    pub worst: Vec<ExceededLimit>,
}

/// The region that exceeds a limit most, over all poses of a limb.
#[derive(Debug, Clone, PartialEq)]
pub struct ExceededLimit {
    /// Medial rotation in half degrees.
    pub step: u32,
    /// The image.
    pub image: PoseImage,
    /// Share of its region that is cut, 0 to 1.
    pub share: f64,
    /// Largest share that the plan allows.
    pub limit: f64,
    /// Number of poses that exceed this limit.
    pub exceeding: usize,
    /// Number of poses of the limb.
    pub poses: usize,
}

impl fmt::Display for ExceededLimit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{:.1} % of the {} at {} degrees, but {} allows {:.1} % ({} of {} poses exceed it)",
            100.0 * self.share,
            self.image,
            angle_text(self.step),
            self.image.key(),
            100.0 * self.limit,
            self.exceeding,
            self.poses
        )
    }
}

fn listed(worst: &[ExceededLimit]) -> String {
    let worst: Vec<String> = worst.iter().map(ExceededLimit::to_string).collect();
    worst.join(", and ")
}
