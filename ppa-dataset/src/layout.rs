//! File names of a dataset: the layout published by the paper's authors.
//!
//! ```text
//! patient_0/depth/{l,r}/{orig,big,small,bumps_a,bumps_b}/depth_cam_{left,right}_{angle}.png
//! patient_0/xray/{l,r}/xray_image_{step}.png   .exr
//! patient_0/labels/{l,r}/roi_depth.json
//! ```
//! with `angle = step / 2` degrees, written with one decimal. All paths are relative to the
//! dataset's root and use `/`.

use std::fmt;

pub use ppa_core::{Side, View};
use serde::{Deserialize, Serialize};

use crate::body_shape::BodyShape;

/// One limb of one person, whose files are below `patient_N/*/{l,r}`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct LimbId {
    /// N of `patient_N`.
    pub patient: u32,
    /// Left or right.
    pub side: Side,
}

impl fmt::Display for LimbId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "limb {} of patient {}", self.side_letter(), self.patient)
    }
}

impl LimbId {
    /// `l` or `r`.
    pub fn side_letter(self) -> &'static str {
        self.side.letter()
    }

    /// Name of a pose of this limb, such as `patient_0_r_036`.
    pub fn unit_name(self, step: u32) -> String {
        format!("patient_{}_{}_{step:03}", self.patient, self.side_letter())
    }

    fn folder(self, kind: &str) -> String {
        format!("patient_{}/{kind}/{}", self.patient, self.side_letter())
    }

    /// The file name of a depth image, used as the key in `roi_depth.json`.
    pub fn depth_name(view: View, step: u32) -> String {
        format!("depth_{}_{}.png", view.name(), angle_text(step))
    }

    /// A depth image: 16-bit PNG, Z in mm, 0 invalid.
    pub fn depth(self, shape: BodyShape, view: View, step: u32) -> String {
        let name = Self::depth_name(view, step);
        format!("{}/{}/{name}", self.folder("depth"), shape.name())
    }

    /// The 16-bit presentation image of a radiograph.
    pub fn radiograph_png(self, step: u32) -> String {
        format!("{}/xray_image_{step}.png", self.folder("xray"))
    }

    /// The tallies of a radiograph as named layers.
    pub fn radiograph_exr(self, step: u32) -> String {
        format!("{}/xray_image_{step}.exr", self.folder("xray"))
    }

    /// Regions of interest of all depth images of this limb.
    pub fn roi_file(self) -> String {
        format!("{}/roi_depth.json", self.folder("labels"))
    }
}

/// The angle of a step as written in file names: `step / 2` degrees with one decimal.
pub fn angle_text(step: u32) -> String {
    format!(
        "{}.{}",
        step / 2,
        if step.is_multiple_of(2) { 0 } else { 5 }
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The examples given in the README of the published dataset.
    #[test]
    fn names_are_those_of_the_published_dataset() {
        let limb = LimbId {
            patient: 0,
            side: Side::Right,
        };
        assert_eq!(
            limb.depth(BodyShape::Orig, View::Left, 180),
            "patient_0/depth/r/orig/depth_cam_left_90.0.png"
        );
        assert_eq!(
            LimbId::depth_name(View::Right, 91),
            "depth_cam_right_45.5.png"
        );
        assert_eq!(
            limb.radiograph_png(180),
            "patient_0/xray/r/xray_image_180.png"
        );
        assert_eq!(limb.roi_file(), "patient_0/labels/r/roi_depth.json");
    }
}
