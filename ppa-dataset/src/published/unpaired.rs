//! Files of poses without depth images.

use std::collections::BTreeSet;
use std::fmt;

use serde::Serialize;

use super::{ImagePair, Pose};
use crate::layout::View;

/// A radiograph, or an entry of a list, whose pose has no depth image, so that no image pair refers to it.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Unpaired {
    /// A radiograph.
    Radiograph {
        /// N of `patient_N`.
        patient: u32,
        /// Path from the root.
        file: String,
    },
    /// A label.
    Label {
        /// Path of its list from the root.
        list: String,
        /// Step, or number of the pose.
        pose: u32,
    },
    /// A region of interest.
    Region {
        /// Path of its list from the root.
        list: String,
        /// Step, or number of the pose.
        pose: u32,
        /// `cam_left` or `cam_right`.
        camera: &'static str,
    },
}

impl fmt::Display for Unpaired {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Radiograph { file, .. } => write!(f, "{file} shows a pose without depth images"),
            Self::Label { list, pose } => {
                write!(
                    f,
                    "{list} has a label for pose {pose}, which has no depth image"
                )
            }
            Self::Region { list, pose, camera } => write!(
                f,
                "{list} has a region of pose {pose} for {camera}, which has no depth image of it"
            ),
        }
    }
}

/// Which poses of a limb (and flexion) have depth images.
pub(super) struct Seen {
    pub poses: BTreeSet<u32>,
    views: BTreeSet<(View, u32)>,
}

impl Seen {
    pub fn of(pairs: &[ImagePair]) -> Self {
        let number = |pair: &ImagePair| match pair.pose {
            Pose::Rotated { step, .. } => step,
            Pose::Recorded { image_number, .. } => image_number,
        };
        let views = pairs.iter().flat_map(|pair| {
            let there = View::ALL
                .into_iter()
                .filter(|&view| pair.depth(view).is_some());
            there.map(move |view| (view, number(pair)))
        });
        Self {
            poses: pairs.iter().map(number).collect(),
            views: views.collect(),
        }
    }

    /// Regions of images that do not exist.
    pub fn regions_of_none<'a>(
        &self,
        list: &str,
        regions: impl Iterator<Item = &'a (View, u32)>,
    ) -> Vec<Unpaired> {
        let of_none = regions.filter(|region| !self.views.contains(region));
        let region = |&(view, pose): &(View, u32)| Unpaired::Region {
            list: list.to_owned(),
            pose,
            camera: view.name(),
        };
        of_none.map(region).collect()
    }
}
