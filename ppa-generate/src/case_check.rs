//! Repeats the preparation of a case and compares the result with the recorded one.

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
    /// The case file cannot be read.
    #[error(transparent)]
    Case(#[from] CaseError),
    /// The limb cannot be prepared, or the scan is not that of the case.
    #[error(transparent)]
    Prepare(#[from] PrepareError),
}

/// Change of the landmarks since the case was written.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Drift {
    /// Distance between the joint centres, mm.
    pub joint_mm: f64,
    /// Angle between the axes, degrees.
    pub axis_deg: f64,
    /// Angle between the anterior directions, degrees.
    pub anterior_deg: f64,
    /// Angle between the planes under the limb, degrees.
    pub plane_deg: f64,
    /// Whether the side or the kind of limb differs.
    pub other_limb: bool,
}

/// Smaller differences are rounding errors, mm and degrees.
const SAME: f64 = 1e-3;

impl Drift {
    /// The change from `was` to `is`.
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

    /// Whether all changes are rounding errors.
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

/// A case whose preparation was repeated.
pub struct CaseCheck {
    /// The case.
    pub case: Case,
    /// Its limb; the scan is the one that the case was made from.
    pub limb: PreparedLimb,
    /// Change of the landmarks since the case was written; `None` if its `[found]` holds no landmarks that this program reads.
    pub drift: Option<Drift>,
}

impl CaseCheck {
    /// Reads a case, repeats its preparation and compares the result with its `[found]`.
    ///
    /// # Errors
    /// [`CaseCheckError`] if the case cannot be read or prepared, or its scan is another one.
    pub fn of(path: &Path) -> Result<Self, CaseCheckError> {
        let case = Case::read(path)?;
        let recorded = recorded_landmarks(&read_text(path).map_err(CaseError::File)?);
        let limb = PreparedLimb::of_case(&case)?;
        let drift = recorded.map(|was| Drift::between(&was, &limb.landmarks));
        Ok(Self { case, limb, drift })
    }

    /// Severe findings that the case does not acknowledge; it should not be used until they are.
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
