//! The computed label of the displayed pose.

use std::sync::{Arc, Mutex, PoisonError};

use nalgebra::Isometry3;
use ppa_label::{Exposure, JointSpace, LabelScale, PoseLabel, ScaleName, read_bones};

use crate::desk::Shown;
use crate::error::StudioError;

/// The joint space of the displayed limb, computed once.
#[derive(Default)]
pub(crate) struct Labels {
    kept: Mutex<Option<(u64, Arc<JointSpace>)>>,
}

impl Labels {
    /// Frees the data computed from the limb.
    pub fn forget_limb(&self) {
        *self.kept.lock().unwrap_or_else(PoisonError::into_inner) = None;
    }

    /// Returns the label of a pose on the graded scale, from the pose of the device in the `ct` frame; `None` if the case names no bones.
    pub fn of(
        &self,
        shown: &Shown,
        ct_from_device: &Isometry3<f64>,
    ) -> Result<Option<PoseLabel>, StudioError> {
        let Some(space) = self.joint_space(shown)? else {
            return Ok(None);
        };
        let joint = shown.prepared().landmarks.joint_centre.into();
        let seen = Exposure::of_device(ct_from_device, joint);
        let scale = LabelScale::new(ScaleName::Graded);
        Ok(Some(PoseLabel::new(&space, seen, &scale)?))
    }

    fn joint_space(&self, shown: &Shown) -> Result<Option<Arc<JointSpace>>, StudioError> {
        let Some(file) = &shown.case.bones else {
            return Ok(None);
        };
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((revision, space)) = &*kept
            && *revision == shown.revision
        {
            return Ok(Some(space.clone()));
        }
        let landmarks = &shown.prepared().landmarks;
        let read = read_bones(file, &landmarks.joint_centre.into())?;
        let ct_from_patient = landmarks.patient_from_ct().inverse();
        let space = Arc::new(JointSpace::new(read.bones, ct_from_patient.isometry())?);
        *kept = Some((shown.revision, space.clone()));
        Ok(Some(space))
    }
}
