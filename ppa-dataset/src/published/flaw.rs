//! Flaws of a dataset.

use super::Unpaired;
use crate::layout::LimbId;
use crate::manifest::RoiRow;

/// Something in a dataset that a training program would stumble over, or never notice.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Flaw {
    /// An image that is missing, damaged, or of other pixels.
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
    /// A pose that only one camera saw, of a limb that both did.
    #[error("{file} has no counterpart from the other camera")]
    OneCamera {
        /// The only depth image.
        file: String,
    },
    /// Two persons with one image: one of them is the other, or a copy.
    #[error("{first} and {second} are the same image, but of different persons")]
    SameImage {
        /// An image.
        first: String,
        /// The image of another person.
        second: String,
    },
    /// Two persons with one scan: they are one person.
    #[error("patients {} and {} come from the same scan according to dataset.json", patients[0], patients[1])]
    SameScan {
        /// Their numbers.
        patients: [u32; 2],
    },
    /// What no image pair mentions.
    #[error("{0}")]
    Unpaired(Unpaired),
    /// Labels of radiographs that were made again since.
    #[error("limb {} of patient {}: {} of radiographs that have since been replaced, the first at step {step}",
        limb.side_letter(), limb.patient, ppa_core::text::count(*count, "label"))]
    Outdated {
        /// The limb.
        limb: LimbId,
        /// Half degrees of rotation of the first of them.
        step: u32,
        /// Their number.
        count: usize,
    },
    /// An image that is not the one in `manifest.jsonl`.
    #[error("{file} is altered: its hash is {found}, but manifest.jsonl has {expected}")]
    Altered {
        /// The image.
        file: String,
        /// Its hash.
        found: String,
        /// That of its row.
        expected: String,
    },
    /// A list that is not the one in `checksums.sha256`.
    #[error("{file} is missing or altered: its hash does not match the one in checksums.sha256")]
    List {
        /// The list.
        file: String,
    },
    /// Labels, grades or a split that are not those in `labels.sha256`.
    #[error(
        "{file} is missing or altered: its hash does not match the one in labels.sha256, which you may remove if you made the change"
    )]
    Labels {
        /// The file.
        file: String,
    },
    /// `checksums.sha256` or `labels.sha256` is not as it was written.
    #[error("{file} is altered: its hash does not match the one in its last line")]
    Checksums {
        /// Which of both.
        file: &'static str,
    },
    /// An image without a row, or a row without an image.
    #[error("{file} is {where}")]
    Unlisted {
        /// The image.
        file: String,
        /// In which of both.
        r#where: &'static str,
    },
    /// Metadata that were written before the dataset changed.
    #[error("{0}")]
    Metadata(String),
    /// The manifest as a whole.
    #[error("{0}")]
    Manifest(String),
}
