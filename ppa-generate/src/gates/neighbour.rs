//! Contact with part of another limb.

use ppa_dataset::findings::{Finding, FindingCode, Severity};
use ppa_mesh::LimbReport;
use ppa_scene::Neighbour;

use super::at;

/// Where limbs touch, HU do not separate their skins, and the border found is up to 4 voxels off. Contacts up to 1 cm² hardly show in an
/// image; 10 cm² is a patch 32 mm wide.
const CONTACT_CAUTION_CM2: f64 = 1.0;
const CONTACT_SEVERE_CM2: f64 = 10.0;

/// In the measured scans, cross-sections of legs change by at most 1.1 percent per mm, those of a hand by 1.5.
const JUMP_PERCENT_PER_MM: f64 = 3.0;

pub(super) fn findings(report: &LimbReport, neighbour: Option<&Neighbour>) -> Vec<Finding> {
    let mut found: Vec<Finding> = contact(report).into_iter().collect();
    let Some(neighbour) = neighbour else {
        return found;
    };
    let jump = neighbour.jump_percent_per_mm;
    if jump > JUMP_PERCENT_PER_MM {
        found.push(at(
            neighbour.jump_centre_mm,
            FindingCode::FusedLimb,
            Severity::Severe,
            jump,
            format!(
                "the cross-section of the limb changes by {jump:.1} % per mm along it, expected at most \
                 {JUMP_PERCENT_PER_MM:.0}: part of another limb or of the couch may be attached from there on"
            ),
        ));
    }
    if let Some(bone_mm) = neighbour.far_bone_mm {
        let [x, y, z] = bone_mm;
        found.push(Finding {
            code: FindingCode::FusedLimb,
            severity: Severity::Severe,
            text: format!(
                "a second tibia-like bone lies far from the first, at {x:.0}, {y:.0}, {z:.0} mm: another leg is fused to \
                 this one (--crop cuts it off)"
            ),
            value: None,
            place_mm: Some(bone_mm),
        });
    }
    found
}

fn contact(report: &LimbReport) -> Option<Finding> {
    let place = report.contact_centre_mm?;
    let contact_cm2 = 1e-2 * report.contact_mm2;
    let severity = match contact_cm2 {
        CONTACT_SEVERE_CM2.. => Severity::Severe,
        CONTACT_CAUTION_CM2.. => Severity::Caution,
        _ => return None,
    };
    let [x, y, z] = place;
    Some(at(
        place,
        FindingCode::FusedLimb,
        severity,
        contact_cm2,
        format!(
            "another body touches the limb over {contact_cm2:.1} cm² around {x:.0}, {y:.0}, {z:.0} mm: the skin there is a \
             guess, and a sliver of the other body may be attached"
        ),
    ))
}
