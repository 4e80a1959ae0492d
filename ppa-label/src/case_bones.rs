//! Checks of a case's bones when the case is prepared rather than when its dataset is labelled.

use std::path::{Path, PathBuf};

use nalgebra::Point3;
use ppa_ct::{Format, Volume, VolumeError, WriteError};
use ppa_dataset::labels::{BoneFile, BoneNumbers};
use ppa_scene::{Landmarks, LimbKind};

use super::openness::{
    AnkleBones, BoneFileError, BonesError, JointSpace, JointSpaceError, read_bones,
};
use super::segment::{SegmentError, segment_bones};

/// Why labels cannot be computed from the bones of a case.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CaseBonesError {
    /// The limb is a knee.
    #[error(
        "the scan was prepared as a knee, but bones are used only for the labels of ankles: prepare it without bones"
    )]
    Knee,
    /// The file that labels the bones.
    #[error(transparent)]
    File(#[from] BoneFileError),
    /// The bones could not be separated.
    #[error(transparent)]
    Segment(#[from] SegmentError),
    /// A bone is missing.
    #[error(transparent)]
    Bones(#[from] BonesError),
    /// No joint space was found between the bones.
    #[error(transparent)]
    JointSpace(#[from] JointSpaceError),
    /// The volume of the bones is invalid.
    #[error(transparent)]
    Volume(#[from] VolumeError),
    /// The name of the file for segmented bones does not determine a format.
    #[error(transparent)]
    Name(#[from] WriteError),
    /// The name of the file for segmented bones would be a DICOM folder.
    #[error(
        "{} would be a DICOM CT in Hounsfield units, but labels are numbers of bones: write NIfTI, NRRD or MetaImage",
        .0.display()
    )]
    Dicom(PathBuf),
    /// The file for segmented bones is the scan.
    #[error("{} is the scan itself", .0.display())]
    Scan(PathBuf),
}

fn require_ankle(landmarks: &Landmarks) -> Result<(), CaseBonesError> {
    match landmarks.limb {
        LimbKind::Knee => Err(CaseBonesError::Knee),
        LimbKind::LowerLeg | LimbKind::Other => Ok(()),
    }
}

/// Checks that a file labels the bones around the joint of a limb.
///
/// # Errors
/// [`CaseBonesError`] for knees, files that cannot be read, and bones that are missing near the joint.
pub fn check_bones(file: &BoneFile, landmarks: &Landmarks) -> Result<(), CaseBonesError> {
    require_ankle(landmarks)?;
    read_bones(file, &landmarks.joint_centre.into())?;
    Ok(())
}

/// Separates the bones in a scan, numbered by [`BoneNumbers::default`], and checks that labels can be computed from them; `limb`
/// states for each voxel whether it belongs to the limb.
///
/// # Errors
/// [`CaseBonesError`] for knees, and for bones that touch or are missing, with the place.
pub fn segment_checked_bones(
    volume: &Volume,
    limb: &[bool],
    landmarks: &Landmarks,
) -> Result<Volume, CaseBonesError> {
    require_ankle(landmarks)?;
    let ct_from_patient = landmarks.patient_from_ct().inverse();
    let ct_from_patient = ct_from_patient.isometry();
    let bones = segment_bones(volume, limb, ct_from_patient)?;
    let joint = ct_from_patient * Point3::origin();
    let numbers = BoneNumbers::default();
    let surfaces = AnkleBones::new(&bones.grid, &bones.labels, numbers, &joint)?;
    JointSpace::new(surfaces, ct_from_patient)?;
    Ok(bones.volume()?)
}

/// Rejects names for segmented bones under which they could not be found later, or which would overwrite the scan.
///
/// # Errors
/// [`CaseBonesError::Name`], [`CaseBonesError::Dicom`] or [`CaseBonesError::Scan`].
pub fn check_segmented_name(bones: &Path, scan: &Path) -> Result<(), CaseBonesError> {
    if Format::of_name(bones)? == Format::Dicom {
        return Err(CaseBonesError::Dicom(bones.to_owned()));
    }
    let same = bones.canonicalize().ok() == scan.canonicalize().ok();
    match bones.exists() && same {
        true => Err(CaseBonesError::Scan(bones.to_owned())),
        false => Ok(()),
    }
}
