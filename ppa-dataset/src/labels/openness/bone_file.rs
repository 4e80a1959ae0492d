//! A file that tells which bone each voxel of a scan belongs to.

use std::path::PathBuf;

use nalgebra::Point3;
use serde::{Deserialize, Serialize};

use super::bones::{AnkleBones, BoneNumbers, BonesError};
use crate::prepare::volume_sha256;

/// Bones of a case: NIfTI, NRRD or MetaImage with a whole number per voxel, 0 for none, in the `ct` frame of the scan; its
/// lattice may be another one.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BoneFile {
    /// The file; relative paths start at the case file.
    pub path: PathBuf,
    /// Which number is which bone.
    #[serde(default)]
    pub numbers: BoneNumbers,
    /// Whether [`segment_bones`](crate::labels::segment_bones) told the bones apart in the scan; else somebody else did.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub segmented: bool,
}

/// Bones of a file, and which they are.
#[derive(Debug, Clone)]
pub struct ReadBones {
    /// Those around the joint.
    pub bones: AnkleBones,
    /// SHA-256 over size, affine and numbers of the file.
    pub sha256: String,
}

/// Why a file does not give the bones of an ankle.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BoneFileError {
    /// It cannot be read.
    #[error(transparent)]
    Read(#[from] ppa_ct::ReadError),
    /// Values that are no labels.
    #[error("{} holds the value {found}, expected whole numbers of bones from 0 to 255", path.display())]
    Value {
        /// The file.
        path: PathBuf,
        /// The value.
        found: f32,
    },
    /// The labels.
    #[error("{}", path.display())]
    Bones {
        /// The file.
        path: PathBuf,
        /// What is wrong with them.
        source: BonesError,
    },
}

impl BoneFile {
    /// Reads the bones around a joint in the `ct` frame.
    ///
    /// # Errors
    /// [`BoneFileError`] naming the file: values that are no labels, a bone missing near the joint.
    pub fn read(&self, joint: &Point3<f64>) -> Result<ReadBones, BoneFileError> {
        let volume = ppa_ct::read(&self.path)?.volume;
        let label = |found: f32| match (0.0..=255.0).contains(&found) && found.fract() == 0.0 {
            true => Ok(found as u8),
            false => Err(BoneFileError::Value {
                path: self.path.clone(),
                found,
            }),
        };
        let labels: Vec<u8> = volume
            .values()
            .iter()
            .map(label)
            .collect::<Result<_, _>>()?;
        let bones = AnkleBones::new(volume.grid(), &labels, self.numbers, joint);
        let sha256 = volume_sha256(&volume);
        let read = bones.map(|bones| ReadBones { bones, sha256 });
        read.map_err(|source| BoneFileError::Bones {
            path: self.path.clone(),
            source,
        })
    }
}
