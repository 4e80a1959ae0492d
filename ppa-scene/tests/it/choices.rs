//! One choice at a time: everything else is found to fit it.

use nalgebra::{Point3, Vector3};
use ppa_scene::{
    AxisSource, LandmarkError, LandmarkNote, LandmarkOverrides, Landmarks, LimbKind, Plane, Side,
    XrayDevice, place,
};

use crate::scan::P01;

fn automatic() -> LandmarkOverrides {
    LandmarkOverrides::default()
}

fn off_axis(landmarks: &Landmarks, p: [f64; 3]) -> f64 {
    let along = Vector3::from(landmarks.axis_direction);
    (Point3::from(p) - Point3::from(landmarks.axis_point))
        .cross(&along)
        .norm()
}

/// Joint on the axis, front across it, regions one after the other, limb in front of the plane and able to rest.
fn assert_consistent(landmarks: &Landmarks, what: &str) {
    assert!(off_axis(landmarks, landmarks.joint_centre) < 1e-6, "{what}");
    let [axis, front] = [landmarks.axis_direction, landmarks.anterior].map(Vector3::from);
    assert!(axis.dot(&front).abs() < 1e-9, "{what}");
    let [distal, proximal] = [landmarks.joint_region, landmarks.calf_region];
    assert!(
        distal.range_mm[1] <= proximal.range_mm[0],
        "{what}: {distal:?} {proximal:?}"
    );
    let patient_from_ct = landmarks.patient_from_ct();
    let plane = landmarks.plane_patient();
    let skin = &P01.skin.vertices;
    let behind = skin
        .iter()
        .filter(|p| plane.signed_distance(&(patient_from_ct * p.cast::<f64>())) < -0.1);
    assert!(
        behind.count() * 50 < skin.len(),
        "{what}: the plane cuts the limb"
    );
    let table = Plane {
        normal: Vector3::z_axis(),
        offset_mm: 0.0,
    };
    let device = XrayDevice::overhead(1040.0, 1100.0);
    let placed = place(skin, landmarks, 0.3, &table, &device).unwrap();
    assert!(
        placed.contact.penetration_mm < 1e-6 && placed.contact.gap_mm < 1e-6,
        "{what}"
    );
}

#[test]
fn any_choice_alone_gives_landmarks_that_fit_it() {
    let found = P01.find(Side::Right, &automatic()).unwrap();
    let [x, y, z] = found.joint_centre;
    let choose = |change: fn(&mut LandmarkOverrides, &Landmarks)| {
        let mut choices = automatic();
        change(&mut choices, &found);
        choices
    };
    let alone: [(&str, LandmarkOverrides); 12] = [
        ("limb", choose(|c, _| c.limb = Some(LimbKind::Other))),
        (
            "joint_centre",
            choose(|c, l| {
                let [x, y, z] = l.joint_centre;
                c.joint_centre = Some([x + 3.0, y - 2.0, z + 15.0]);
            }),
        ),
        (
            "joint_region",
            choose(|c, _| c.joint_region = Some([20.0, 40.0])),
        ),
        (
            "joint_region beyond the calf region's beginning",
            choose(|c, _| {
                c.joint_region = Some([60.0, 145.0]);
            }),
        ),
        (
            "calf_region",
            choose(|c, _| c.calf_region = Some([150.0, 180.0])),
        ),
        (
            "calf_region before the joint region's end",
            choose(|c, _| {
                c.calf_region = Some([70.0, 110.0]);
            }),
        ),
        (
            "axis_source",
            choose(|c, _| c.axis_source = Some(AxisSource::Limb)),
        ),
        (
            "anterior",
            choose(|c, _| c.anterior = Some([0.5, -1.0, 0.2])),
        ),
        (
            "plane_points",
            choose(|c, l| c.plane_points = Some(l.plane_points)),
        ),
        (
            "axis",
            choose(|c, l| {
                let [x, y, z] = l.joint_centre;
                c.axis = Some([[x + 2.0, y, z], [x - 5.0, y + 4.0, z + 150.0]]);
            }),
        ),
        (
            "axis from proximal to distal",
            choose(|c, l| {
                let [x, y, z] = l.joint_centre;
                c.axis = Some([[x - 5.0, y + 4.0, z + 150.0], [x + 2.0, y, z]]);
            }),
        ),
        ("nothing", automatic()),
    ];
    for (what, choices) in &alone {
        let landmarks = P01
            .find(Side::Right, choices)
            .unwrap_or_else(|e| panic!("{what}: {e}"));
        assert_consistent(&landmarks, what);
        let given = [
            (choices.joint_region, landmarks.joint_region),
            (choices.calf_region, landmarks.calf_region),
        ];
        for (given, got) in given {
            assert!(given.is_none_or(|range| range == got.range_mm), "{what}");
        }
        if let Some(points) = choices.axis {
            let aside = points.map(|p| off_axis(&landmarks, p));
            assert!(aside.iter().all(|mm| *mm < 1e-6), "{what}: {aside:?}");
            assert_eq!(landmarks.axis_source, AxisSource::Given);
            assert!(landmarks.axis_direction[2] > 0.9, "{what}");
            // The level of the joint is still that of the gap in the bones.
            let rise = Vector3::from(landmarks.scan_direction)
                .dot(&(Point3::from(landmarks.joint_centre) - Point3::new(x, y, z)));
            assert!(rise.abs() < 1e-6, "{what}: {rise}");
        }
        if let Some(centre) = choices.joint_centre {
            assert_eq!(landmarks.joint_centre, centre, "{what}");
        }
    }
    let left = P01.find(Side::Left, &automatic()).unwrap();
    assert_consistent(&left, "side");
}

#[test]
fn a_given_axis_passes_nearest_to_a_given_joint() {
    let found = P01.find(Side::Right, &automatic()).unwrap();
    let [x, y, z] = found.joint_centre;
    let choices = LandmarkOverrides {
        axis: Some([[x, y, z - 50.0], [x, y, z + 150.0]]),
        joint_centre: Some([x + 6.0, y + 8.0, z + 7.0]),
        ..automatic()
    };
    let got = P01.find(Side::Right, &choices).unwrap();
    let off = Point3::from(got.joint_centre) - Point3::new(x, y, z + 7.0);
    assert!(off.norm() < 1e-6, "{off:?}");
    assert!(
        got.notes.iter().any(|note| matches!(
            note,
            LandmarkNote::JointMovedToAxis { aside_mm } if (aside_mm - 10.0).abs() < 1e-6
        )),
        "{:?}",
        got.notes
    );
    let open = got.open_choices(&choices);
    assert!(open.axis.is_none() && open.joint_centre.is_none() && open.joint_region.is_none());
    assert_eq!(open.limb, Some(LimbKind::LowerLeg));
}

/// The axis shown as a choice is the one that was found.
#[test]
fn the_axis_found_is_the_axis_when_it_is_chosen() {
    let found = P01.find(Side::Right, &automatic()).unwrap();
    let choices = LandmarkOverrides {
        axis: found.open_choices(&automatic()).axis,
        ..automatic()
    };
    let got = P01.find(Side::Right, &choices).unwrap();
    let difference = found.patient_from_ct().isometry().to_homogeneous()
        - got.patient_from_ct().isometry().to_homogeneous();
    assert!(difference.amax() < 1e-9, "{difference}");
}

#[test]
fn an_axis_that_cannot_be_is_refused() {
    let refused = |choices: LandmarkOverrides| P01.find(Side::Right, &choices).unwrap_err();
    let axis = |from: [f64; 3], to: [f64; 3]| LandmarkOverrides {
        axis: Some([from, to]),
        ..automatic()
    };
    for (choices, part) in [
        (axis([0.0; 3], [0.0, 0.0, 5.0]), "10 mm apart"),
        (axis([0.0; 3], [200.0, 0.0, 5.0]), "45 degrees"),
        (axis([0.0; 3], [f64::NAN, 0.0, 5.0]), "finite"),
    ] {
        let said = refused(choices).to_string();
        assert!(said.contains("axis") && said.contains(part), "{said}");
    }
    let twice = LandmarkOverrides {
        joint_region: Some([20.0, 40.0]),
        ..axis([0.0; 3], [0.0, 0.0, 100.0])
    };
    let error = refused(twice);
    assert_eq!(
        error,
        LandmarkError::AxisTwice {
            other: "joint_region"
        }
    );
    let without = LandmarkOverrides {
        axis_source: Some(AxisSource::Given),
        ..automatic()
    };
    assert_eq!(refused(without), LandmarkError::NoAxis);
}
