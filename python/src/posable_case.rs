//! A case with its scan and its limb, as objects of Python share it.

use std::sync::{Arc, Mutex, PoisonError};

use ppa_ct::Scan;
use ppa_generate::{Case, ExposableLimb, JointError, PreparedLimb};

use crate::scene::Scene;

/// A case, its scan and its limb.
pub struct PosableCase {
    pub case: Case,
    pub scan: Scan,
    pub prepared: Arc<PreparedLimb>,
    /// The limb before the x-ray device of the last scene.
    exposable: Mutex<Option<(Arc<Scene>, ExposableLimb)>>,
}

impl PosableCase {
    pub fn new(case: Case, scan: Scan, prepared: PreparedLimb) -> Self {
        Self {
            case,
            scan,
            prepared: Arc::new(prepared),
            exposable: Mutex::new(None),
        }
    }

    /// The limb before the x-ray device of a scene, kept for the next exposure.
    pub fn exposable(&self, scene: &Arc<Scene>) -> Result<ExposableLimb, ExposableError> {
        let mut kept = self
            .exposable
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        if let Some((of, limb)) = &*kept
            && Arc::ptr_eq(of, scene)
        {
            return Ok(limb.clone());
        }
        let spectrum = Arc::new(ppa_generate::spectrum(&scene.plan.xray)?);
        let (prepared, table) = (self.prepared.clone(), scene.table.clone());
        let limb = ExposableLimb::new(prepared, &scene.plan, table, spectrum)?;
        *kept = Some((scene.clone(), limb.clone()));
        Ok(limb)
    }

    /// Whether the scan of the case lies in a file.
    pub fn is_of_file(&self) -> bool {
        !self.case.source.path.as_os_str().is_empty()
    }
}

/// Why a limb cannot be exposed.
#[derive(Debug, thiserror::Error)]
pub enum ExposableError {
    #[error(transparent)]
    Beam(#[from] ppa_generate::SceneSetupError),
    #[error(transparent)]
    Joint(#[from] JointError),
}
