//! The file that labels the bones of a case.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

/// Bones of a case: NIfTI, NRRD or MetaImage with a whole number per voxel, 0 for none, in the `ct` frame of the scan; its
/// lattice may differ from that of the scan.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BoneFile {
    /// The file; a relative path is resolved against the folder of the case file.
    pub path: PathBuf,
    /// Number of each bone.
    #[serde(default)]
    pub numbers: BoneNumbers,
    /// Whether `ppa prepare --segment-bones` segmented the scan; otherwise another program or a person did.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub segmented: bool,
}

/// Label of each bone; the defaults are those of `ppa ct phantom --labels`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BoneNumbers {
    /// Label of the tibia.
    pub tibia: u8,
    /// Label of the fibula.
    pub fibula: u8,
    /// Label of the talus.
    pub talus: u8,
}

impl Default for BoneNumbers {
    fn default() -> Self {
        Self {
            tibia: 3,
            fibula: 4,
            talus: 1,
        }
    }
}
