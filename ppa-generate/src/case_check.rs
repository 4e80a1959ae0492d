//! Carries out the decisions of a case again and compares the result with what was found before.

use std::path::Path;

use nalgebra::{Point3, Vector3};
use ppa_dataset::files::read_text;
use ppa_dataset::findings::{Finding, Severity};
use ppa_scene::{Landmarks, Plane};
use serde::{Deserialize, Serialize};

use crate::case::{Case, CaseError};
use crate::prepared_limb::{PrepareError, PreparedLimb};

/// Why a case cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CaseCheckError {
    /// Its file cannot be read.
    #[error(transparent)]
    Case(#[from] CaseError),
    /// Its decisions cannot be carried out, or its scan is another one.
    #[error(transparent)]
    Prepare(#[from] PrepareError),
}

/// How far landmarks lie from those that were found when the case was written.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Drift {
    /// Distance of the joints, mm.
    pub joint_mm: f64,
    /// Angle between the axes, degrees.
    pub axis_deg: f64,
    /// Angle between the fronts, degrees.
    pub anterior_deg: f64,
    /// Angle between the planes under the limb, degrees.
    pub plane_deg: f64,
    /// Whether the side or the kind of limb is another one.
    pub other_limb: bool,
}

/// Below these a difference is rounding, mm and degrees.
const SAME: f64 = 1e-3;

impl Drift {
    /// From `was` to `is`.
    pub fn between(was: &Landmarks, is: &Landmarks) -> Self {
        let angle = |a: [f64; 3], b: [f64; 3]| {
            let (a, b) = (Vector3::from(a), Vector3::from(b));
            a.cross(&b).norm().atan2(a.dot(&b)).to_degrees()
        };
        let plane = |landmarks: &Landmarks| -> [f64; 3] {
            let ct_from_patient = landmarks.patient_from_ct().inverse();
            let plane: Plane = landmarks
                .plane_patient()
                .transformed(ct_from_patient.isometry());
            plane.normal.into_inner().into()
        };
        let joints = [was, is].map(|landmarks| Point3::from(landmarks.joint_centre));
        Self {
            joint_mm: (joints[1] - joints[0]).norm(),
            axis_deg: angle(was.axis_direction, is.axis_direction),
            anterior_deg: angle(was.anterior, is.anterior),
            plane_deg: angle(plane(was), plane(is)),
            other_limb: was.side != is.side || was.limb != is.limb,
        }
    }

    /// Whether nothing has changed but roundings.
    pub fn is_none(&self) -> bool {
        let changes = [
            self.joint_mm,
            self.axis_deg,
            self.anterior_deg,
            self.plane_deg,
        ];
        !self.other_limb && changes.iter().all(|change| *change < SAME)
    }
}

/// A case that was read and carried out again.
pub struct CaseCheck {
    /// The case.
    pub case: Case,
    /// Its limb; the scan is the one that the case was made from.
    pub limb: PreparedLimb,
    /// Change of the landmarks since the case was written; `None` if its `[found]` holds none that this program reads.
    pub drift: Option<Drift>,
}

impl CaseCheck {
    /// Reads a case, carries its decisions out again and compares the result with its `[found]`.
    ///
    /// # Errors
    /// [`CaseCheckError`] when that cannot be done, also because the scan is another one.
    pub fn of(path: &Path) -> Result<Self, CaseCheckError> {
        let case = Case::read(path)?;
        let recorded = recorded_landmarks(&read_text(path).map_err(CaseError::File)?);
        let limb = PreparedLimb::of_case(&case)?;
        let drift = recorded.map(|was| Drift::between(&was, &limb.landmarks));
        Ok(Self { case, limb, drift })
    }

    /// Severe findings that the case does not acknowledge: it should not be used before they are.
    pub fn open(&self) -> impl Iterator<Item = &Finding> {
        let acknowledged = &self.case.acknowledged;
        let findings = self.limb.findings.iter();
        findings.filter(move |f| f.severity == Severity::Severe && !acknowledged.contains(&f.code))
    }
}

/// The landmarks in `[found]`; `None` if there are none, or if they are not of this version.
fn recorded_landmarks(text: &str) -> Option<Landmarks> {
    #[derive(Deserialize)]
    struct Recorded {
        found: Found,
    }
    #[derive(Deserialize)]
    struct Found {
        landmarks: Landmarks,
    }
    let recorded: Recorded = toml::from_str(text).ok()?;
    Some(recorded.found.landmarks)
}
