//! Identity of a pose: limb and angle.

use std::fmt;

use ppa_dataset::BodyShape;
use ppa_dataset::layout::{LimbId, Side, View, angle_text};

/// Folder inside a dataset that holds the records.
pub(crate) const FOLDER: &str = ".ppa";

/// One pose of one limb.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) struct PoseId {
    /// The limb.
    pub limb: LimbId,
    /// Medial rotation in half degrees.
    pub step: u32,
}

impl fmt::Display for PoseId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} at {} degrees", self.limb, angle_text(self.step))
    }
}

impl PoseId {
    /// Parses a name in the form of [`LimbId::unit_name`].
    pub fn of_unit_name(name: &str) -> Option<Self> {
        let mut parts = name.strip_prefix("patient_")?.split('_');
        let (patient, side, step) = (parts.next()?, parts.next()?, parts.next()?);
        let pose = Self {
            limb: LimbId {
                patient: patient.parse().ok()?,
                side: Side::ALL.into_iter().find(|known| known.letter() == side)?,
            },
            step: step.parse().ok()?,
        };
        (pose.limb.unit_name(pose.step) == name).then_some(pose)
    }

    /// Possible paths of its images: depth images of all body shapes and cameras, then its radiograph.
    pub fn images(self) -> Vec<String> {
        let Self { limb, step } = self;
        let depth = BodyShape::ALL
            .into_iter()
            .flat_map(|shape| View::ALL.map(|view| limb.depth(shape, view, step)));
        depth
            .chain([limb.radiograph_png(step), limb.radiograph_exr(step)])
            .collect()
    }

    /// The pose that an image of the given path belongs to.
    pub fn of_image(file: &str) -> Option<Self> {
        let mut parts = file.strip_prefix("patient_")?.split('/');
        let patient = parts.next()?.parse().ok()?;
        let (kind, side, name) = (parts.next()?, parts.next()?, parts.next_back()?);
        let (stem, _) = name.rsplit_once('.')?;
        let number = stem.rsplit('_').next()?;
        let step = match kind {
            "depth" => {
                let (degrees, tenths) = number.split_once('.')?;
                let halves = u32::from(tenths == "5");
                degrees.parse::<u32>().ok()?.checked_mul(2)? + halves
            }
            _ => number.parse().ok()?,
        };
        let side = Side::ALL.into_iter().find(|known| known.letter() == side)?;
        let limb = LimbId { patient, side };
        let pose = Self { limb, step };
        pose.images()
            .iter()
            .any(|image| image == file)
            .then_some(pose)
    }

    /// File name of its record.
    pub fn record_name(self) -> String {
        self.limb.unit_name(self.step) + ".json"
    }

    /// Path of its record from the dataset's root.
    pub fn record_file(self) -> String {
        format!("{FOLDER}/{}", self.record_name())
    }

    /// The pose whose record has the given file name.
    pub fn of_record(name: &str) -> Option<Self> {
        Self::of_unit_name(name.strip_suffix(".json")?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_pose_of_an_image_follows_from_its_path() {
        let limb = LimbId {
            patient: 12,
            side: Side::Left,
        };
        for step in [0, 7, 180] {
            let pose = PoseId { limb, step };
            for image in pose.images() {
                assert_eq!(PoseId::of_image(&image), Some(pose), "{image}");
            }
        }
        for other in [
            "patient_12/depth/l/orig/depth_cam_left_3.6.png",
            "patient_12/xray/l/xray_image_007.png",
            "patient_12/labels/l/roi_depth.json",
            "manifest.jsonl",
        ] {
            assert_eq!(PoseId::of_image(other), None, "{other}");
        }
    }

    #[test]
    fn only_names_of_poses_are_read_as_poses() {
        let limb = LimbId {
            patient: 12,
            side: Side::Left,
        };
        let pose = PoseId { limb, step: 7 };
        assert_eq!(PoseId::of_unit_name(&limb.unit_name(7)), Some(pose));
        assert_eq!(pose.to_string(), "limb l of patient 12 at 3.5 degrees");
        for other in [
            "patient_12_l_7",
            "patient_012_l_007",
            "patient_12_l_007_1",
            "patient_12_x_007",
            "notes",
        ] {
            assert_eq!(PoseId::of_unit_name(other), None, "{other}");
        }
    }
}
