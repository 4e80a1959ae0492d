//! Flaws of a dataset.

use super::Unpaired;
use crate::layout::LimbId;
use crate::manifest::RoiRow;

/// A flaw of a dataset that a training program would fail on, or never notice.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Flaw {
    /// An image that is missing, damaged, or has the wrong kind of pixels.
    #[error("{0}")]
    Image(String),
    /// A region that reaches beyond its image.
    #[error(
        "{file} has {width} x {height} pixels, but its region reaches to column {} and row {}",
        roi.x_start.saturating_add(roi.size), roi.y_start.saturating_add(roi.size)
    )]
    RoiOutside {
        /// The depth image.
        file: String,
        /// Its columns.
        width: u32,
        /// Its rows.
        height: u32,
        /// Its region.
        roi: RoiRow,
    },
    /// A pose seen by only one camera, of a limb that both cameras saw.
    #[error("{file} has no counterpart from the other camera")]
    OneCamera {
        /// The only depth image.
        file: String,
    },
    /// Two persons with the same image: both are one person, or one image is a copy.
    #[error("{first} and {second} are the same image, but of different persons")]
    SameImage {
        /// An image.
        first: String,
        /// The image of another person.
        second: String,
    },
    /// Two persons with the same scan: they are one person.
    #[error("patients {} and {} come from the same scan according to dataset.json", patients[0], patients[1])]
    SameScan {
        /// Their numbers.
        patients: [u32; 2],
    },
    /// A file or entry that belongs to no image pair.
    #[error("{0}")]
    Unpaired(Unpaired),
    /// Labels of radiographs that have since been replaced.
    #[error("limb {} of patient {}: {} of radiographs that have since been replaced, the first at step {step}",
        limb.side_letter(), limb.patient, ppa_core::text::count(*count, "label"))]
    Outdated {
        /// The limb.
        limb: LimbId,
        /// Half degrees of rotation of the first of these radiographs.
        step: u32,
        /// Their number.
        count: usize,
    },
    /// An image that differs from `manifest.jsonl`.
    #[error("{file} is altered: its hash is {found}, but manifest.jsonl has {expected}")]
    Altered {
        /// The image.
        file: String,
        /// Its hash.
        found: String,
        /// The hash in its row.
        expected: String,
    },
    /// A list that differs from `checksums.sha256`.
    #[error("{file} is missing or altered: its hash does not match the one in checksums.sha256")]
    List {
        /// The list.
        file: String,
    },
    /// Labels, grades or a split that differ from `labels.sha256`.
    #[error(
        "{file} is missing or altered: its hash does not match the one in labels.sha256, which you may remove if you made the change"
    )]
    Labels {
        /// The file.
        file: String,
    },
    /// `checksums.sha256` or `labels.sha256` was changed after it was written.
    #[error("{file} is altered: its hash does not match the one in its last line")]
    Checksums {
        /// Which of the two.
        file: &'static str,
    },
    /// An image without a row, or a row without an image.
    #[error("{file} is {where}")]
    Unlisted {
        /// The image.
        file: String,
        /// Where it is listed or missing.
        r#where: &'static str,
    },
    /// Metadata that were written before the dataset changed.
    #[error("{0}")]
    Metadata(String),
    /// An error that concerns the manifest itself.
    #[error("{0}")]
    Manifest(String),
}
