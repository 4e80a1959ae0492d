//! Measures of a limb and its landmarks.

use nalgebra::{Rotation3, Vector3};
use ppa_phantom::{LowerLeg, TableTop};
use ppa_scene::{LandmarkNote, LandmarkOverrides, Landmarks, LimbMeasures, Side};

use crate::scan::{P01, Scan};

fn measured(scan: &Scan, choices: &LandmarkOverrides) -> (Landmarks, LimbMeasures) {
    let landmarks = scan.find(Side::Right, choices).unwrap();
    let measures = LimbMeasures::of(&scan.volume, &scan.skin, &scan.mask, &landmarks).unwrap();
    (landmarks, measures)
}

#[test]
fn a_phantom_measures_what_it_was_drawn_with() {
    let (landmarks, measures) = measured(&P01, &LandmarkOverrides::default());
    let truth = LowerLeg::p01().truth();
    let size = measures.size;
    let voxels = P01.mask.iter().filter(|inside| **inside).count();
    assert!(
        (size.volume_mm3 - 8.0 * voxels as f64).abs() < 1.0,
        "{size:?}"
    );
    // 250 mm of leg above the joint, and the foot below it.
    assert!((310.0..350.0).contains(&size.length_mm), "{size:?}");
    let shaft = measures.shaft.unwrap();
    let off = Vector3::from(shaft.direction)
        .angle(&truth.axis_direction)
        .to_degrees();
    assert!(
        off < 1.0 && shaft.off_axis_deg < 1.0,
        "{shaft:?}, {off:.2} degrees"
    );
    assert!(measures.support.span_mm > 150.0, "{:?}", measures.support);
    assert!(
        measures.support.pitch_error_deg < 0.5,
        "{:?}",
        measures.support
    );
    let neighbour = measures.neighbour.unwrap();
    assert!(
        neighbour.jump_percent_per_mm < 2.0 && neighbour.far_bone_mm.is_none(),
        "{neighbour:?}"
    );
    assert!(matches!(
        landmarks.notes[..],
        [LandmarkNote::AnkleFound {
            joint_above_mm: 0.0,
            ..
        }]
    ));
}

/// For any rotation of the leg in the scanner, and any given side.
#[test]
fn the_fibula_tells_the_side_at_every_rotation() {
    for side in [Side::Right, Side::Left] {
        let leg = LowerLeg::family("P04", side).unwrap();
        let scan = Scan::of(leg.voxelise(2.0, TableTop::Absent).unwrap());
        for degrees in [-60.0_f64, 0.0, 60.0] {
            let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), degrees.to_radians());
            let (_, measures) = measured(&scan.turned(&turn), &LandmarkOverrides::default());
            let fibula = measures.fibula.unwrap();
            assert_eq!(fibula.side(), Some(side), "{degrees} degrees: {fibula:?}");
        }
    }
}

/// An axis moved by the choice of its regions' centres is inclined to the shaft by the change of its direction.
#[test]
fn an_axis_through_the_skin_is_inclined_to_the_shaft() {
    let choices = LandmarkOverrides {
        axis_source: Some(ppa_scene::AxisSource::Limb),
        ..LandmarkOverrides::default()
    };
    let (landmarks, measures) = measured(&P01, &choices);
    let truth = LowerLeg::p01().truth().axis_direction;
    let expected = Vector3::from(landmarks.axis_direction)
        .angle(&truth)
        .to_degrees();
    let found = measures.shaft.unwrap().off_axis_deg;
    assert!(
        expected > 2.0 && (found - expected).abs() < 0.7,
        "{found:.2} for {expected:.2} degrees"
    );
}

#[test]
fn a_joint_outside_and_a_front_backwards_are_noted() {
    let found = P01
        .find(Side::Right, &LandmarkOverrides::default())
        .unwrap();
    let [x, y, z] = found.joint_centre;
    let choices = LandmarkOverrides {
        joint_centre: Some([x + 70.0, y, z]),
        anterior: Some([0.0, 1.0, 0.2]),
        ..LandmarkOverrides::default()
    };
    let notes = P01.find(Side::Right, &choices).unwrap().notes;
    let outside = |note: &LandmarkNote| matches!(note, LandmarkNote::JointOutside { distance_mm } if (10.0..60.0).contains(distance_mm));
    let backwards = |note: &LandmarkNote| matches!(note, LandmarkNote::AnteriorReversed { angle_deg } if *angle_deg > 170.0);
    assert!(
        notes.iter().any(outside) && notes.iter().any(backwards),
        "{notes:?}"
    );
}
