//! Plausibility of the limb's size.

use ppa_dataset::findings::{Finding, FindingCode, Severity};
use ppa_mesh::LimbReport;
use ppa_scene::{Landmarks, LimbSize};

use super::at;

/// Smallest volume that can be posed, cm³: a child's wrist 4 cm long.
const LEAST_CM3: f64 = 50.0;

/// Both regions of the axis are a tenth of this apart in the least case, mm.
const LEAST_MM: f64 = 40.0;

/// Shorter limbs are doubted, mm: the regions of their axis are less than half of it apart, so that errors of 1 mm in both centres rotate
/// the axis by more than 2 degrees.
const SHORT_MM: f64 = 100.0;

/// Thinner limbs are doubted, cm²: the wrist of a small woman, 13.5 cm around, has 14.5.
const THIN_CM2: f64 = 12.0;

/// Thicker limbs are doubted, cm²: a thigh 80 cm around has 510, and a trunk more than 600.
const THICK_CM2: f64 = 550.0;

/// What was found is far too small for a limb.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error(
    "what was found is {volume_cm3:.0} cm³ and {length_mm:.0} mm long, expected a limb of at least {LEAST_CM3:.0} cm³ and \
     {LEAST_MM:.0} mm: does the scan show a limb? (--inside or --crop selects another part of it, --iso-hu another skin)"
)]
pub struct NotALimb {
    /// Its volume, cm³.
    pub volume_cm3: f64,
    /// Longest side of the box of voxels around it, mm.
    pub length_mm: f64,
}

/// Refuses a body too small for a limb, before landmarks are searched for.
pub(crate) fn require_limb(report: &LimbReport, spacing_mm: [f64; 3]) -> Result<(), NotALimb> {
    let side = |axis: usize| (report.high[axis] - report.low[axis]) as f64 * spacing_mm[axis];
    let volume_cm3 = 1e-3 * report.limb_mm3;
    let length_mm = (0..3).map(side).fold(0.0, f64::max);
    if volume_cm3 < LEAST_CM3 || length_mm < LEAST_MM {
        return Err(NotALimb {
            volume_cm3,
            length_mm,
        });
    }
    Ok(())
}

pub(super) fn findings(size: &LimbSize, landmarks: &Landmarks) -> Vec<Finding> {
    let mut found = Vec::new();
    let place = landmarks.joint_centre;
    if size.length_mm < SHORT_MM {
        found.push(at(
            place,
            FindingCode::LimbTooSmall,
            Severity::Severe,
            size.length_mm,
            format!(
                "the scan shows {:.0} mm of the limb, expected at least {SHORT_MM:.0}: over a shorter length its axis is \
                 wrong by more than 2 degrees if its centres are wrong by 1 mm",
                size.length_mm
            ),
        ));
    }
    let section_cm2 = 1e-2 * size.section_mm2;
    if section_cm2 < THIN_CM2 {
        found.push(at(
            place,
            FindingCode::LimbTooSmall,
            Severity::Severe,
            section_cm2,
            format!(
                "cross-sections of the limb measure {section_cm2:.1} cm² (median), expected at least {THIN_CM2:.0}, \
                 less than the wrist of a small adult"
            ),
        ));
    }
    if section_cm2 > THICK_CM2 {
        found.push(at(
            place,
            FindingCode::LimbTooLarge,
            Severity::Severe,
            section_cm2,
            format!(
                "cross-sections of the limb measure {section_cm2:.0} cm² (median), expected at most {THICK_CM2:.0}, \
                 the thigh of a large adult: is it a trunk?"
            ),
        ));
    }
    found
}
