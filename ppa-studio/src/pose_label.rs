//! The computed label of the pose that is shown.

use std::sync::{Arc, Mutex, PoisonError};

use nalgebra::Isometry3;
use ppa_label::{Exposure, JointSpace, LabelScale, ScaleName, read_bones};
use serde::Serialize;

use crate::desk::Shown;
use crate::error::StudioError;

/// A grade by the graded scale, as `ppa label auto` computes it.
#[derive(Debug, Serialize)]
pub(crate) struct PoseLabel {
    /// 1 (ideal) to 3 (inadequate); diagnostic below 2.5.
    label: f64,
    std: f64,
    gutters: [GutterLabel; 3],
}

#[derive(Debug, Serialize)]
struct GutterLabel {
    name: &'static str,
    /// 0 closed to 1 open.
    openness: f64,
    grade: f64,
}

/// The joint space of the limb that is shown, found once.
#[derive(Default)]
pub(crate) struct Labels {
    kept: Mutex<Option<(u64, Arc<JointSpace>)>>,
}

impl Labels {
    /// The label of a pose, by the place of the device in the `ct` frame; none where the case names no bones.
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
        let openness = space.openness(&[seen])?[0];
        let computed = LabelScale::new(ScaleName::Graded).grade(&openness, &space.hidden(&seen));
        let [medial, superior, lateral] = computed.gutters;
        let gutter = |name, openness, grade| GutterLabel {
            name,
            openness,
            grade,
        };
        Ok(Some(PoseLabel {
            label: computed.label,
            std: computed.std,
            gutters: [
                gutter("medial", openness.medial[1], medial),
                gutter("superior", openness.superior, superior),
                gutter("lateral", openness.lateral[1], lateral),
            ],
        }))
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
