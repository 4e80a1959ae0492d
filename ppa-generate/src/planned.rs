//! `dataset.json` read back: the intended content of a dataset.

use std::path::Path;

use ppa_core::Part;
use ppa_dataset::files::{FileError, read_text};
use ppa_dataset::manifest::DESCRIPTION_FILE;
use ppa_scene::Sweep;
use serde::Deserialize;

use crate::limb_jobs::{LimbJobs, PlannedLimb, jobs_of_part};
use crate::seal::{Opened, opened};

/// The planned poses of a dataset and the hashes of their inputs.
pub(crate) struct Planned {
    /// The text of `dataset.json`.
    pub text: String,
    /// Whether its files carry hashes, which those of earlier versions did not.
    pub sealed: bool,
    planned: PlannedPoses,
}

#[derive(Deserialize)]
struct PlannedPoses {
    version: u32,
    rotation: Sweep,
    limbs: Vec<PlannedLimb>,
}

impl Planned {
    pub fn read(root: &Path) -> Result<Self, FileError> {
        let path = root.join(DESCRIPTION_FILE);
        Self::of_text(read_text(&path)?, &path)
    }

    /// Parses a `dataset.json` that was read from `path`.
    pub fn of_text(text: String, path: &Path) -> Result<Self, FileError> {
        let seal = opened(&text);
        let planned: PlannedPoses =
            serde_json::from_str(&text).map_err(|e| FileError::at("parse", path)(e.into()))?;
        let sealed = matches!(seal, Opened::Sealed(_));
        if !sealed && (planned.version > 1 || seal == Opened::Broken) {
            let damaged = std::io::Error::other(
                "it is damaged: its hash does not match the one stored in it",
            );
            return Err(FileError::at("use", path)(damaged));
        }
        planned
            .rotation
            .poses()
            .map_err(|e| FileError::at("use", path)(std::io::Error::other(e)))?;
        Ok(Self {
            text,
            sealed,
            planned,
        })
    }

    /// The pose jobs of one shard, limb by limb.
    pub fn part(&self, part: Part) -> Vec<LimbJobs> {
        let poses = self.planned.rotation.poses();
        let poses = poses.expect("the rotation was checked when it was read");
        jobs_of_part(self.planned.limbs.iter().cloned(), &poses, part)
    }
}
