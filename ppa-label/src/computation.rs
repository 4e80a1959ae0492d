//! `openness.json`: settings of the computed labels.

use ppa_dataset::labels::LabelSource;
use ppa_dataset::labels::{BoneFile, BoneNumbers};
use serde::Serialize;

use super::openness::{FREE_CHORDS_MM, LabelScale};

/// Everything that the labels of the same radiographs depend on.
#[derive(Debug, Clone, Copy, Serialize)]
pub(super) struct Computation<'a> {
    pub label_source: LabelSource,
    /// Hash of the sources that compute labels.
    code: &'static str,
    pub thresholds: &'a LabelScale,
    free_chords_mm: [f64; 3],
    bones: ComputedFrom<'a>,
}

#[derive(Debug, Clone, Copy, Serialize)]
struct ComputedFrom<'a> {
    /// Hash of size, affine and numbers: the file name does not enter datasets.
    sha256: &'a str,
    numbers: BoneNumbers,
    segmented: bool,
}

impl<'a> Computation<'a> {
    pub fn new(file: &BoneFile, sha256: &'a str, thresholds: &'a LabelScale) -> Self {
        Self {
            label_source: thresholds.source(file.segmented),
            code: env!("PPA_LABEL_CODE"),
            thresholds,
            free_chords_mm: FREE_CHORDS_MM,
            bones: ComputedFrom {
                sha256,
                numbers: file.numbers,
                segmented: file.segmented,
            },
        }
    }

    pub fn to_json(self) -> String {
        serde_json::to_string_pretty(&self).expect("thresholds are finite numbers")
    }
}
