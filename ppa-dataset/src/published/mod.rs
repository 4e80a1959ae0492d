//! Datasets in the two layouts that the paper's authors published, read as one kind of row.
//!
//! ```text
//! synthetic  patient_0/depth/{l,r}/{orig,big,small,bumps_a,bumps_b}/depth_cam_{left,right}_{angle}.png
//!            patient_0/xray/{l,r}/xray_image_{step}.png
//!            patient_0/labels/{l,r}/{labels,roi_depth}.json
//! specimen   patient_1_l/{min,medium,max}/data/dataset/depth/depth_cam_{left,right}_orig_{image}_{timestamp}.png
//!            …/xray/xray_{image}.png   …/label/quality/labels.json   …/label/roi/roi_depth.json
//! ```
//! In both, N of `patient_N` is the person, so `patient_1_l` and `patient_1_r` are the two feet of one person. A side, a flexion, a
//! body shape, a camera, radiographs, labels and regions of interest may be missing; the existing files must fit the layout.
//!
//! [`Published::read`] reads names and JSON files; [`GrayImage16::read`] decodes an image.

mod against_lists;
mod convert;
mod converted_lists;
mod entries;
mod error;
mod flaw;
mod folders;
mod gray16;
mod inspect;
mod outdated;
mod specimen;
mod synthetic;
mod unpaired;

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

pub use self::convert::{ConvertError, Converted, convert};
pub use self::error::PublishedError;
pub use self::flaw::Flaw;
pub use self::gray16::{GrayImage16, ImageFileError};
pub use self::inspect::{Inspection, inspect};
pub use self::unpaired::Unpaired;
use crate::archive::require_folder;
use crate::body_shape::BodyShape;
use crate::labels::{LabelFile, LabelName, LabelSource};
use crate::layout::{LimbId, View};
use crate::manifest::{Manifest, RoiRow};

/// One of the two published layouts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Layout {
    /// Poses on a grid of angles, several body shapes.
    Synthetic,
    /// Poses as they were recorded, three flexions of the foot.
    Specimen,
}

/// How far the foot of a specimen was flexed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Flexion {
    /// Least.
    Min,
    /// Medium.
    Medium,
    /// Most.
    Max,
}

impl Flexion {
    /// All three.
    pub const ALL: [Self; 3] = [Self::Min, Self::Medium, Self::Max];

    /// Folder name in the specimen layout.
    pub fn name(self) -> &'static str {
        match self {
            Self::Min => "min",
            Self::Medium => "medium",
            Self::Max => "max",
        }
    }
}

/// The pose of a limb that an image shows. Ordered by pose first, so that all images of a pose are neighbours.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(untagged)]
pub enum Pose {
    /// A pose of the synthetic layout.
    Rotated {
        /// Half degrees of medial rotation.
        step: u32,
        /// Variant of the skin; radiograph, label and region of interest are shared by all variants of the pose.
        shape: BodyShape,
    },
    /// A pose of the specimen layout.
    Recorded {
        /// Flexion of the foot.
        flexion: Flexion,
        /// Number of the pose within limb and flexion, which determines radiograph, label and region of interest.
        image_number: u32,
        /// Increases with time from image to image of a pose; no unit.
        timestamp: u64,
    },
}

/// The images of both cameras at one moment, with their pose, radiograph and label.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ImagePair {
    /// Person and side.
    #[serde(flatten)]
    pub limb: LimbId,
    /// Its pose.
    #[serde(flatten)]
    pub pose: Pose,
    /// Image of the left camera. At least one of the two cameras has an image.
    pub left: Option<DepthFile>,
    /// Image of the right camera.
    pub right: Option<DepthFile>,
    /// Radiograph of the pose: path from the root.
    pub radiograph: Option<String>,
    /// Quality of the pose.
    pub label: Option<Label>,
}

impl ImagePair {
    /// The image of one camera.
    pub fn depth(&self, view: View) -> Option<&DepthFile> {
        match view {
            View::Left => self.left.as_ref(),
            View::Right => self.right.as_ref(),
        }
    }

    fn depth_mut(&mut self, view: View) -> &mut Option<DepthFile> {
        match view {
            View::Left => &mut self.left,
            View::Right => &mut self.right,
        }
    }
}

/// A depth image: 16-bit PNG, mm, 0 invalid.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct DepthFile {
    /// Path from the root.
    pub file: String,
    /// Square region around the joint; may extend beyond the image.
    pub roi: Option<RoiRow>,
}

/// Quality of a pose, as graded or computed.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Label {
    /// From 1 (ideal) to 3 (inadequate).
    pub label: f64,
    /// Standard deviation over the readers (divided by their number, not one less); of a computed label, half the range of grades.
    pub std: f64,
    /// Source of the label, if the file states it.
    pub source: Option<LabelSource>,
}

/// A dataset on disk.
#[derive(Debug, Clone, PartialEq)]
pub struct Published {
    /// The folder that holds the folders of the persons.
    pub root: PathBuf,
    /// Its layout.
    pub layout: Layout,
    /// By person, side and pose.
    pub pairs: Vec<ImagePair>,
    /// Files and entries of poses without depth images.
    pub unpaired: Vec<Unpaired>,
}

/// Image pairs and unpaired files of a person or limb.
type Found = (Vec<ImagePair>, Vec<Unpaired>);

impl Published {
    /// Lists the dataset in `root` without decoding its images.
    ///
    /// # Errors
    /// [`PublishedError`] naming the first file or entry that fits neither layout, or labels of radiographs that have since been
    /// replaced.
    pub fn read(root: &Path) -> Result<Self, PublishedError> {
        Self::read_labelled(root, None)
    }

    /// The same as [`Published::read`], with the labels in `labels.NAME.json` instead of those in `labels.json`.
    ///
    /// # Errors
    /// The same as [`Published::read`].
    pub fn read_labelled(root: &Path, labels: Option<&LabelName>) -> Result<Self, PublishedError> {
        let dataset = Self::list_labelled(root, labels)?;
        let found = outdated::outdated(&dataset, labels, || {
            // Without a manifest, the dataset is unfinished or not ours.
            match root.join(Manifest::FILE).exists() {
                true => Ok(Manifest::read(root)?),
                false => Ok(Manifest::default()),
            }
        })?;
        match found.first() {
            None => Ok(dataset),
            Some(outdated) => Err(PublishedError::Outdated {
                path: LabelFile::named_path(root, outdated.limb, labels),
                step: outdated.steps[0],
                count: outdated.steps.len(),
            }),
        }
    }

    /// The same as [`Published::read`], but accepts labels of radiographs that have since been replaced.
    ///
    /// # Errors
    /// The same as [`Published::read`], except for those labels.
    pub fn list(root: &Path) -> Result<Self, PublishedError> {
        Self::list_labelled(root, None)
    }

    fn list_labelled(root: &Path, labels: Option<&LabelName>) -> Result<Self, PublishedError> {
        require_folder(root)?;
        let subjects = folders::subjects(root)?;
        let (mut pairs, mut unpaired) = (Vec::new(), Vec::new());
        for subject in &subjects.folders {
            let patient = subject.patient;
            let found = match subject.side {
                None => synthetic::read(root, patient, labels)?,
                Some(side) => {
                    let folder = folders::Folder::new(root, &subject.name);
                    specimen::read(&folder, LimbId { patient, side }, labels)?
                }
            };
            pairs.extend(found.0);
            unpaired.extend(found.1);
        }
        pairs.sort_by_key(|pair| (pair.limb, pair.pose));
        Ok(Self {
            root: root.to_owned(),
            layout: subjects.layout,
            pairs,
            unpaired,
        })
    }

    /// The persons in the dataset, in order.
    pub fn patients(&self) -> Vec<u32> {
        let mut patients: Vec<_> = self.pairs.iter().map(|pair| pair.limb.patient).collect();
        patients.dedup();
        patients
    }
}
