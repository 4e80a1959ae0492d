//! Reading the bone labels of the voxels of a scan.

use std::path::PathBuf;

use nalgebra::Point3;
use ppa_dataset::labels::BoneFile;

use super::bones::{AnkleBones, BonesError};

/// Bones read from a file.
#[derive(Debug, Clone)]
pub struct ReadBones {
    /// The bones around the joint.
    pub bones: AnkleBones,
    /// SHA-256 over size, affine and numbers of the file.
    pub sha256: String,
}

/// Why a file does not give the bones of an ankle.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BoneFileError {
    /// The file cannot be read.
    #[error(transparent)]
    Read(#[from] ppa_ct::ReadError),
    /// A value that is not a label.
    #[error("{} holds the value {found}, expected whole numbers of bones from 0 to 255", path.display())]
    Value {
        /// The file.
        path: PathBuf,
        /// The value.
        found: f32,
    },
    /// The labels do not give the bones.
    #[error("{}", path.display())]
    Bones {
        /// The file.
        path: PathBuf,
        /// The error.
        source: BonesError,
    },
}

/// Reads the bones around a joint in the `ct` frame.
///
/// # Errors
/// [`BoneFileError`] naming the file, for values that are not labels or a bone that is missing near the joint.
pub fn read_bones(file: &BoneFile, joint: &Point3<f64>) -> Result<ReadBones, BoneFileError> {
    let volume = ppa_ct::read(&file.path)?.volume;
    let label = |found: f32| match (0.0..=255.0).contains(&found) && found.fract() == 0.0 {
        true => Ok(found as u8),
        false => Err(BoneFileError::Value {
            path: file.path.clone(),
            found,
        }),
    };
    let labels: Vec<u8> = volume
        .values()
        .iter()
        .map(label)
        .collect::<Result<_, _>>()?;
    let bones = AnkleBones::new(volume.grid(), &labels, file.numbers, joint);
    let sha256 = volume.sha256();
    let read = bones.map(|bones| ReadBones { bones, sha256 });
    read.map_err(|source| BoneFileError::Bones {
        path: file.path.clone(),
        source,
    })
}
