//! Data of a dataset, in addition to its manifest, that computed labels need.

use nalgebra::Isometry3;
use ppa_dataset::files::{FileError, read_text};
use ppa_dataset::layout::LimbId;
use ppa_dataset::manifest::DESCRIPTION_FILE;
use ppa_dataset::manifest::{FileRow, Manifest};
use ppa_xray::Detector;
use serde::Deserialize;

use super::openness::{JointSpace, Reading, Visibility};
use super::tallies::{Tallies, TalliesError};

/// The part of `dataset.json` that describes detector and scans.
#[derive(Deserialize)]
pub(super) struct Described {
    source_detector_mm: f64,
    settings: DescribedSettings,
    limbs: Vec<DescribedLimb>,
}

#[derive(Deserialize)]
struct DescribedSettings {
    xray: DescribedXray,
}

#[derive(Deserialize)]
struct DescribedXray {
    detector: Detector,
}

#[derive(Deserialize)]
struct DescribedLimb {
    #[serde(flatten)]
    limb: LimbId,
    volume_sha256: String,
}

impl Described {
    pub fn read(manifest: &Manifest) -> Result<Self, FileError> {
        let path = manifest.root.join(DESCRIPTION_FILE);
        serde_json::from_str(&read_text(&path)?)
            .map_err(|error| FileError::at("parse", &path)(error.into()))
    }

    /// Hash of the scan that a limb was made from.
    pub fn scan_of(&self, limb: LimbId) -> Option<&str> {
        let found = self.limbs.iter().find(|found| found.limb == limb);
        found.map(|found| found.volume_sha256.as_str())
    }

    /// Visibility of the gutters in a radiograph, computed from its tallies.
    pub fn visibility(
        &self,
        manifest: &Manifest,
        row: &FileRow,
        ct_from_device: &Isometry3<f64>,
        space: &JointSpace,
    ) -> Result<Visibility, TalliesError> {
        let detector = &self.settings.xray.detector;
        let path = manifest.root.join(row.limb.radiograph_exr(row.step));
        let tallies = Tallies::read(&path, [detector.columns, detector.rows])?;
        Ok(space.visibility(&Reading {
            detector,
            source_detector_mm: self.source_detector_mm,
            ct_from_device,
            value: &tallies.value,
            sigma: &tallies.sigma,
        }))
    }
}
