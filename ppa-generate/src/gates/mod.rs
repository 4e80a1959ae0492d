//! Gates: plausibility checks of `ppa prepare` on a limb, each with its value and limit.
//!
//! The values come from [`LimbMeasures`] and [`LimbReport`](ppa_mesh::LimbReport) and are judged here. Everything follows from scan, skin
//! and landmarks, so that an edited case gets new findings.

mod axis;
mod joint;
mod neighbour;
mod side;
mod size;
mod support;

use ppa_ct::Volume;
use ppa_mesh::Limb;
use ppa_scene::{LandmarkError, Landmarks, LimbMeasures};

use ppa_dataset::findings::{Finding, FindingCode, Severity};

pub use size::NotALimb;
pub(crate) use size::require_limb;

/// Returns the findings about a limb with its landmarks, severe ones first.
///
/// # Errors
/// [`LandmarkError::Reslice`] when the scan cannot be cut across the limb.
pub(crate) fn findings(
    volume: &Volume,
    limb: &Limb,
    landmarks: &Landmarks,
) -> Result<Vec<Finding>, LandmarkError> {
    let measures = LimbMeasures::of(volume, &limb.mesh, &limb.mask, landmarks)?;
    let mut found = size::findings(&measures.size, landmarks);
    found.extend(neighbour::findings(
        &limb.report,
        measures.neighbour.as_ref(),
    ));
    found.extend(joint::findings(volume, &limb.report, landmarks));
    found.extend(axis::findings(landmarks, measures.shaft.as_ref()));
    found.extend(side::finding(landmarks, measures.fibula.as_ref()));
    found.extend(support::findings(
        volume,
        &limb.report,
        landmarks,
        &measures.support,
    ));
    found.sort_by_key(|finding| std::cmp::Reverse(finding.severity));
    Ok(found)
}

/// A finding at a place.
fn at(
    place_mm: [f64; 3],
    code: FindingCode,
    severity: Severity,
    value: f64,
    text: String,
) -> Finding {
    Finding {
        code,
        severity,
        text,
        value: Some(value),
        place_mm: Some(place_mm),
    }
}
