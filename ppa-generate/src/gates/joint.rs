//! Plausibility of the joint and of its position.

use nalgebra::{Point3, Vector3};
use ppa_ct::Volume;
use ppa_dataset::findings::{Finding, FindingCode, Severity};
use ppa_mesh::LimbReport;
use ppa_scene::{Joint, KneeAxis, LandmarkNote, Landmarks, LimbKind};

use super::at;

/// A joint farther than this along the limb from the ankle that the scan shows is doubted, mm: the talar dome has a radius of about 20.
const OFF_ANKLE_MM: f64 = 10.0;

/// A joint farther than this to one side of the ankle that the scan shows is doubted, mm: an axis through centres of the skin passes up to
/// 13 mm from it.
const BESIDE_ANKLE_MM: f64 = 20.0;

/// A joint that was moved farther than this onto a given axis is doubted, mm.
const BESIDE_AXIS_MM: f64 = 5.0;

pub(super) fn findings(
    volume: &Volume,
    report: &LimbReport,
    landmarks: &Landmarks,
) -> Vec<Finding> {
    let place = landmarks.joint_centre;
    let mut found = Vec::new();
    found.extend(no_joint(volume, report, landmarks));
    found.extend(beside_ankle(landmarks));
    if landmarks.scan_direction[2] < 0.0 {
        found.push(at(
            place,
            FindingCode::ProximalIsInferior,
            Severity::Caution,
            landmarks.scan_direction[2],
            "the joint lies superior to the calf or inferior to the thigh, so proximal was assumed to be inferior: is \
             the scan's orientation correct, and with it left and right?"
                .to_owned(),
        ));
    }
    for note in &landmarks.notes {
        found.extend(match *note {
            LandmarkNote::AnkleFound {
                depth_hu,
                joint_above_mm,
            } => off_ankle(place, depth_hu, joint_above_mm),
            LandmarkNote::JointOutside { distance_mm } => Some(at(
                place,
                FindingCode::JointOutside,
                Severity::Caution,
                distance_mm,
                format!("the joint centre lies {distance_mm:.1} mm outside the limb"),
            )),
            LandmarkNote::AnteriorReversed { angle_deg } => Some(at(
                place,
                FindingCode::AnteriorReversed,
                Severity::Caution,
                angle_deg,
                format!(
                    "the anterior direction is {angle_deg:.0} degrees from that of the patient in the scan, expected at most \
                     90: at angle 0 the limb lies on its front"
                ),
            )),
            LandmarkNote::JointMovedToAxis { aside_mm } => joint_beside_axis(place, aside_mm),
            LandmarkNote::OtherJoint { joint, at_mm } => Some(other_joint(joint, at_mm)),
            LandmarkNote::PlateauCut => Some(doubt(
                place,
                FindingCode::PlateauCut,
                "the scan cuts the tibial plateau: the notch between the condyles is used as the middle of the knee",
            )),
            LandmarkNote::KneeAxis(axis) => knee_axis(place, axis),
            LandmarkNote::CondylesNotSeen => Some(doubt(
                place,
                FindingCode::CondylesNotSeen,
                "the scan does not show the back of both condyles: angle 0 is the pose in the scan",
            )),
            _ => None,
        });
    }
    found
}

/// A caution without a value.
fn doubt(place: [f64; 3], code: FindingCode, text: &str) -> Finding {
    Finding {
        code,
        severity: Severity::Caution,
        text: text.to_owned(),
        value: None,
        place_mm: Some(place),
    }
}

/// Finding that the joint was moved onto a given axis.
fn joint_beside_axis(place: [f64; 3], aside_mm: f64) -> Option<Finding> {
    (aside_mm > BESIDE_AXIS_MM).then(|| {
        at(
            place,
            FindingCode::JointOffAxis,
            Severity::Caution,
            aside_mm,
            format!(
                "the joint was {aside_mm:.1} mm away from the given axis; the limb rotates about the point of the axis nearest to it"
            ),
        )
    })
}

/// Finding that the scan shows both joints of the lower leg; the limb is posed about the other one.
fn other_joint(joint: Joint, at_mm: [f64; 3]) -> Finding {
    let [x, y, z] = at_mm;
    let article = match joint {
        Joint::Ankle => "an",
        Joint::Knee => "a",
    };
    Finding {
        code: FindingCode::OtherJoint,
        severity: Severity::Note,
        text: format!(
            "the scan also shows {article} {joint} around {x:.0}, {y:.0}, {z:.0} mm (--limb chooses the joint)"
        ),
        value: None,
        place_mm: Some(at_mm),
    }
}

/// Finding that the axis of a knee follows the femur's shaft or both shafts.
fn knee_axis(place: [f64; 3], axis: KneeAxis) -> Option<Finding> {
    let text = match axis {
        KneeAxis::Tibia => return None,
        KneeAxis::Femur => {
            "the axis runs along the femur's shaft, which is inclined to the leg's long axis by about 6 degrees: the scan shows too \
             little of the tibia"
        }
        KneeAxis::Both => {
            "the axis runs through tibia and femur: the scan shows too little of either shaft to define it alone"
        }
    };
    Some(doubt(place, FindingCode::KneeAxis, text))
}

fn off_ankle(place: [f64; 3], depth_hu: f64, joint_above_mm: f64) -> Option<Finding> {
    let towards = match joint_above_mm > 0.0 {
        true => "proximal",
        false => "distal",
    };
    let distance_mm = joint_above_mm.abs();
    (distance_mm > OFF_ANKLE_MM).then(|| {
        at(
            place,
            FindingCode::JointOffAnkle,
            Severity::Caution,
            joint_above_mm,
            format!(
                "the joint lies {distance_mm:.0} mm {towards} to the ankle that the scan shows (a gap {depth_hu:.0} HU darker \
                 than the bone on either side)"
            ),
        )
    })
}

/// Finding that the joint of a lower leg is to one side of its ankle.
fn beside_ankle(landmarks: &Landmarks) -> Option<Finding> {
    let place = landmarks.joint_centre;
    let ankle = landmarks.joints.iter().find(|j| j.joint == Joint::Ankle)?;
    let off = Point3::from(place) - Point3::from(ankle.centre_mm);
    let axis = Vector3::from(landmarks.axis_direction);
    let aside_mm = off.cross(&axis).norm();
    let is_doubted = landmarks.limb == LimbKind::LowerLeg && aside_mm > BESIDE_ANKLE_MM;
    is_doubted.then(|| {
        let text =
            format!("the joint lies {aside_mm:.0} mm to one side of the ankle that the scan shows");
        let (code, severity) = (FindingCode::JointOffAnkle, Severity::Caution);
        at(place, code, severity, aside_mm, text)
    })
}

/// Finding that no joint was recognised and the middle of the limb is used.
///
/// Judged by the position of the joint, since a case records a found joint as a choice.
fn no_joint(volume: &Volume, report: &LimbReport, landmarks: &Landmarks) -> Option<Finding> {
    if landmarks.limb != LimbKind::Other {
        return None;
    }
    let direction = Vector3::from(landmarks.scan_direction);
    let corners = (0..8).map(|corner: usize| {
        let end = |axis: usize| match corner >> axis & 1 {
            0 => report.low[axis] as f64,
            _ => (report.high[axis] - 1) as f64,
        };
        let place: Point3<f64> = volume.grid().centre([0, 1, 2].map(end));
        direction.dot(&place.coords)
    });
    let (low, high) = corners.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), level| {
        (low.min(level), high.max(level))
    });
    let joint_mm = direction.dot(&Vector3::from(landmarks.joint_centre));
    let off_mm = joint_mm - 0.5 * (low + high);
    let is_middle = off_mm.abs() < 2.0;
    is_middle.then(|| {
        at(
            landmarks.joint_centre,
            FindingCode::NoJoint,
            Severity::Severe,
            off_mm,
            "no joint was recognised: the limb rotates about the middle of what the scan shows, and regions of interest and \
             beam are centred there (--joint gives its centre)"
                .to_owned(),
        )
    })
}
