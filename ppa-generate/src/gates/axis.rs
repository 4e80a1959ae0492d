//! Angle between the axis of rotation and the bone.

use ppa_dataset::findings::{Finding, FindingCode, Severity};
use ppa_scene::{AxisSource, Landmarks, LimbKind, Shaft};

use super::at;

/// Rotating a limb by θ about an axis inclined by φ to its bone tilts the bone by 2 asin(sin(θ/2) sin φ), at 90 degrees by 1.41 φ. A joint
/// space 3 mm wide and 25 mm deep closes to the beam at 6.8 degrees: 4 degrees use up most of that, 2 degrees less than half.
const CAUTION_DEG: f64 = 2.0;
const SEVERE_DEG: f64 = 4.0;

/// Where the calf region of a lower leg ends if the scan is long enough, mm proximal of the joint.
const CALF_END_MM: f64 = 200.0;

pub(super) fn findings(landmarks: &Landmarks, shaft: Option<&Shaft>) -> Vec<Finding> {
    let mut found = Vec::new();
    let of_leg = landmarks.limb == LimbKind::LowerLeg;
    if let Some(shaft) = shaft.filter(|shaft| shaft.off_axis_deg > CAUTION_DEG) {
        let severity = match shaft.off_axis_deg > SEVERE_DEG {
            true => Severity::Severe,
            false => Severity::Caution,
        };
        let [from, to] = shaft.range_mm;
        let advice = match landmarks.axis_source {
            AxisSource::Limb => {
                " (the axis passes through centres of the skin; --axis-source bone uses those of the bone)"
            }
            AxisSource::Bone | AxisSource::Given => "",
        };
        found.push(at(
            shaft.centre_mm,
            FindingCode::AxisOffShaft,
            severity,
            shaft.off_axis_deg,
            format!(
                "the axis of rotation is inclined by {:.1} degrees to the bone's shaft, seen from {from:.0} to {to:.0} mm \
                 proximal to the joint, expected at most {CAUTION_DEG:.0}{advice}",
                shaft.off_axis_deg
            ),
        ));
    }
    if of_leg && landmarks.axis_source == AxisSource::Limb {
        found.push(Finding {
            code: FindingCode::AxisWithoutBone,
            severity: Severity::Caution,
            text: "the axis passes through centres of the skin, not of the tibia: swelling and muscle move it off the \
                   joint"
                .to_owned(),
            value: None,
            place_mm: Some(landmarks.axis_point),
        });
    }
    let end_mm = landmarks.calf_region.range_mm[1];
    if of_leg && end_mm < CALF_END_MM {
        found.push(at(
            landmarks.calf_region.centre_mm,
            FindingCode::RegionsCloser,
            Severity::Note,
            end_mm,
            format!(
                "the regions that define the axis end {end_mm:.0} mm proximal to the joint; in a scan that is long enough, \
                 they end at {CALF_END_MM:.0} mm"
            ),
        ));
    }
    found
}
