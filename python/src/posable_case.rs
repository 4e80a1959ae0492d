//! A case with its scan and its limb, shared by Python objects.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use ppa_ct::Scan;
use ppa_generate::{Case, ExposableLimb, JointError, PreparedLimb};
use ppa_label::{BoneFileError, JointSpace, JointSpaceError, read_bones};

use crate::scene::Scene;

/// A case, its scan and its limb.
pub struct PosableCase {
    pub case: Case,
    pub scan: Scan,
    pub prepared: Arc<PreparedLimb>,
    /// The limb, ready for exposure in the last scene.
    exposable: Mutex<Option<(Arc<Scene>, ExposableLimb)>>,
    /// The joint space between the bones, computed for the first label.
    joint_space: Mutex<Option<Arc<JointSpace>>>,
}

impl PosableCase {
    pub fn new(case: Case, scan: Scan, prepared: PreparedLimb) -> Self {
        Self {
            case,
            scan,
            prepared: Arc::new(prepared),
            exposable: Mutex::new(None),
            joint_space: Mutex::new(None),
        }
    }

    /// The limb, ready for exposure in a scene; kept for the next exposure.
    pub fn exposable(&self, scene: &Arc<Scene>) -> Result<ExposableLimb, ExposableError> {
        if let Some((of, limb)) = &*held(&self.exposable)
            && Arc::ptr_eq(of, scene)
        {
            return Ok(limb.clone());
        }
        let spectrum = Arc::new(ppa_generate::spectrum(&scene.plan.xray)?);
        let (prepared, table) = (self.prepared.clone(), scene.table.clone());
        let limb = ExposableLimb::new(prepared, &scene.plan, table, spectrum)?;
        *held(&self.exposable) = Some((scene.clone(), limb.clone()));
        Ok(limb)
    }

    /// The joint space between the bones of the case, kept for the next label.
    pub fn joint_space(&self) -> Result<Arc<JointSpace>, LabelError> {
        if let Some(space) = &*held(&self.joint_space) {
            return Ok(space.clone());
        }
        let file = self.case.bones.as_ref().ok_or(LabelError::NoBones)?;
        let landmarks = &self.prepared.landmarks;
        let read = read_bones(file, &landmarks.joint_centre.into())?;
        let ct_from_patient = landmarks.patient_from_ct().inverse();
        let space = Arc::new(JointSpace::new(read.bones, ct_from_patient.isometry())?);
        *held(&self.joint_space) = Some(space.clone());
        Ok(space)
    }

    /// Whether the scan of the case was read from a file.
    pub fn is_of_file(&self) -> bool {
        !self.case.source.path.as_os_str().is_empty()
    }
}

/// Locks what is kept. Do not hold the lock while worker threads compute: a waiting worker may take up another call on the same case.
fn held<T>(kept: &Mutex<T>) -> MutexGuard<'_, T> {
    kept.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Why the joint space of a limb cannot be graded.
#[derive(Debug, thiserror::Error)]
pub enum LabelError {
    #[error("the case does not specify bones: prepare it with bones or segment_bones")]
    NoBones,
    #[error(transparent)]
    Bones(#[from] BoneFileError),
    #[error(transparent)]
    JointSpace(#[from] JointSpaceError),
}

/// Why a limb cannot be exposed.
#[derive(Debug, thiserror::Error)]
pub enum ExposableError {
    #[error(transparent)]
    Beam(#[from] ppa_generate::SceneSetupError),
    #[error(transparent)]
    Joint(#[from] JointError),
}
