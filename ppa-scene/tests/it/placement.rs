//! Placement of the limb on the table: contacts, rotation and sides.

use nalgebra::{Isometry3, Point3, Vector3};
use ppa_scene::{PlaceError, Placement, Plane, Rigid, Side, XrayDevice, ct_from_device, place};
use proptest::prelude::*;

use crate::boot::{TOES_CT, boot, boot_landmarks, moved};
use crate::frames::isometries;

fn table() -> Plane {
    Plane {
        normal: Vector3::z_axis(),
        offset_mm: 0.0,
    }
}

fn device() -> XrayDevice {
    XrayDevice::overhead(1040.0, 1100.0)
}

fn placed(side: Side, angle_deg: f64) -> Placement {
    let angle = f64::to_radians(angle_deg);
    place(
        &boot(side),
        &boot_landmarks(side),
        angle,
        &table(),
        &device(),
    )
    .unwrap()
}

fn toes_in_room(side: Side, angle_deg: f64) -> Point3<f64> {
    let patient_from_ct = boot_landmarks(side).patient_from_ct();
    placed(side, angle_deg).room_from_patient * (patient_from_ct * TOES_CT)
}

/// The patient lies on the back with the head towards +y, so the patient's left is at +x: the
/// midline lies at +x of a right leg, and medial rotation brings the toes there.
#[test]
fn medial_rotation_turns_toes_towards_the_midline() {
    for angle in [5.0, 40.0, 90.0] {
        let right = toes_in_room(Side::Right, angle);
        let left = toes_in_room(Side::Left, angle);
        let expected = 180.0 * f64::to_radians(angle).sin();
        assert!(
            (right.x - expected).abs() < 1e-6,
            "right at {angle}: {right}"
        );
        assert!((left.x + expected).abs() < 1e-6, "left at {angle}: {left}");
    }
    let up = toes_in_room(Side::Right, 0.0);
    assert!(
        up.z > 200.0 && up.y < -50.0,
        "toes up and at the foot end: {up}"
    );
}

#[test]
fn left_and_right_are_mirror_images() {
    let (right_points, left_points) = (boot(Side::Right), boot(Side::Left));
    for angle in [0.0, 33.0, 90.0] {
        let room_from_ct =
            |side| placed(side, angle).room_from_patient * boot_landmarks(side).patient_from_ct();
        let (right, left) = (room_from_ct(Side::Right), room_from_ct(Side::Left));
        for (r, l) in right_points.iter().zip(&left_points) {
            let (r, l) = (right * r.cast::<f64>(), left * l.cast::<f64>());
            let mirrored = Point3::new(-l.x, l.y, l.z);
            assert!((r - mirrored).norm() < 1e-6, "at {angle}: {r} and {l}");
        }
    }
}

/// T_opt rotates about the room's X axis only, both ends rest, nothing sinks, and the joint stays
/// on the central beam.
#[test]
fn limb_rests_on_both_ends_at_every_angle() {
    for half_degrees in 0..=180 {
        let placement = placed(Side::Right, f64::from(half_degrees) / 2.0);
        let contact = placement.contact;
        assert!(
            contact.penetration_mm < 1e-9 && contact.gap_mm < 1e-9,
            "{contact:?}"
        );
        let apart = (contact.distal_mm - contact.proximal_mm).abs();
        assert!(apart <= 0.05 + 1e-9, "{contact:?}");
        let turn = placement.t_opt.isometry().rotation.scaled_axis();
        assert!(turn.yz().norm() < 1e-12, "T_opt turns about {turn}");
        let joint = placement.room_from_patient * Point3::origin();
        assert!(
            joint.x.abs() < 1e-9 && joint.y.abs() < 1e-9,
            "joint at {joint}"
        );
        let chain = placement.t_opt * placement.t_mat * placement.t_rot;
        assert_eq!(chain, placement.room_from_patient);
    }
}

/// At angle 0 the boot rests on its heel (50 mm behind the axis, 30 mm below the joint at the
/// highest) and on the upper end of its shaft (50 mm behind, 250 mm above): no tilt is needed.
#[test]
fn known_contact_at_angle_zero() {
    let placement = placed(Side::Right, 0.0);
    assert!(
        placement.contact.tilt_rad.abs() < 1e-3,
        "{:?}",
        placement.contact
    );
    let joint = placement.room_from_patient * Point3::origin();
    assert!(
        (joint.z - 50.0).abs() < 1e-3,
        "joint {} mm above the table",
        joint.z
    );
    let axis = placement.room_from_patient.rotate(&Vector3::z());
    assert!((axis - Vector3::y()).norm() < 1e-3, "axis along {axis}");
}

/// On its side, the boot rests on the sole's inner edge (45 mm) and the upper end of the shaft
/// (50 mm): the joint is where the line between them puts it.
#[test]
fn known_contact_at_ninety_degrees() {
    let placement = placed(Side::Right, 90.0);
    // Inner edge at 70 mm below the joint up to z = -70, shaft end at 250 mm.
    let tilt = -f64::atan2(-50.0 + 45.0, 250.0 + 70.0);
    assert!(
        (placement.contact.tilt_rad - tilt).abs() < 0.05 / 100.0,
        "{:?}",
        placement.contact
    );
    let height = 45.0 * tilt.cos() + 70.0 * tilt.sin();
    let joint = placement.room_from_patient * Point3::origin();
    assert!(
        (joint.z - height).abs() < 0.05,
        "{} instead of {height}",
        joint.z
    );
}

#[test]
fn a_limb_without_foot_is_split_in_the_middle() {
    let calf: Vec<_> = boot(Side::Right)
        .into_iter()
        .filter(|p| p.z >= 0.0)
        .collect();
    let placement = place(
        &calf,
        &boot_landmarks(Side::Right),
        0.3,
        &table(),
        &device(),
    )
    .unwrap();
    assert!((placement.contact.split_mm - 125.0).abs() < 1e-9);
    assert!(placement.contact.penetration_mm < 1e-9);
    // The cone's lower line must lie flat: its half-angle is atan(10/250).
    let tilt = f64::atan2(10.0, 250.0);
    assert!(
        (placement.contact.tilt_rad - tilt).abs() < 0.05 / 100.0,
        "{:?}",
        placement.contact
    );
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    /// Origin and rotation of the scan make no difference in the room.
    #[test]
    fn placement_does_not_depend_on_the_scan_frame(motion in isometries(), angle in 0.0..1.6_f64) {
        let (points, landmarks) = (boot(Side::Right), boot_landmarks(Side::Right));
        let turned: Vec<Point3<f32>> =
            points.iter().map(|p| (motion * p.cast::<f64>()).cast()).collect();
        let turned_landmarks = moved(&landmarks, &motion);
        let here = place(&points, &landmarks, angle, &table(), &device()).unwrap();
        let there = place(&turned, &turned_landmarks, angle, &table(), &device()).unwrap();
        // f32 coordinates of up to 4 m are rounded to 0.25 µm; the tilt amplifies it and
        // may stop anywhere within τ of rest.
        let p = Point3::new(10.0, 20.0, 100.0);
        prop_assert!((here.room_from_patient * p - there.room_from_patient * p).norm() < 0.1);
    }

    /// Wherever Π_P is, T_mat brings it onto the table and T_opt the limb to rest. T_mat is
    /// close to half a turn here, where converting matrices to quaternions is hard.
    #[test]
    fn any_plane_under_the_limb_will_do(slopes in prop::array::uniform2(-0.6..0.6_f64), angle in 0.0..1.6_f64) {
        let mut landmarks = boot_landmarks(Side::Right);
        let points = boot(Side::Right);
        for p in &mut landmarks.plane_points {
            p[1] += slopes[0] * p[0] + slopes[1] * p[2];
        }
        let placement = place(&points, &landmarks, angle, &table(), &device()).unwrap();
        let matched = landmarks.plane_patient().transformed(placement.t_mat.isometry());
        prop_assert!((matched.normal.into_inner() - Vector3::z()).norm() < 1e-9);
        prop_assert!(matched.offset_mm.abs() < 1e-9);
        let contact = placement.contact;
        prop_assert!(contact.penetration_mm < 1e-9 && contact.gap_mm < 1e-9, "{contact:?}");
        prop_assert!((contact.distal_mm - contact.proximal_mm).abs() < 0.051, "{contact:?}");
    }

    /// A recorded room may stand in any frame, with the table tilted against the beam.
    #[test]
    fn placement_follows_the_room_frame(room in isometries(), angle in 0.0..1.6_f64) {
        let upright = device();
        let turned = XrayDevice {
            room_from_device: Rigid::new(room * upright.room_from_device.isometry()),
            ..upright
        };
        let tilt = Isometry3::rotation(Vector3::new(0.05, -0.03, 0.0));
        let tilted = table().transformed(&tilt);
        let (points, landmarks) = (boot(Side::Right), boot_landmarks(Side::Right));
        let here = place(&points, &landmarks, angle, &tilted, &upright).unwrap();
        let moved_table = tilted.transformed(&room);
        let there = place(&points, &landmarks, angle, &moved_table, &turned).unwrap();
        prop_assert!(there.contact.penetration_mm < 1e-7 && there.contact.gap_mm < 1e-7);
        let device_from = |p: &Placement, d: &XrayDevice| ct_from_device(p, &landmarks, d).inverse();
        let (a, b) = (device_from(&here, &upright), device_from(&there, &turned));
        let p = Point3::new(10.0, 20.0, 100.0);
        prop_assert!((a * p - b * p).norm() < 1e-6);
        // The joint lies on the central beam: the device's z axis.
        prop_assert!((a * Point3::origin()).coords.xy().norm() < 1e-7);
    }
}

/// (T^P_CT)⁻¹ (T^ToF_P)⁻¹ · device: the source seen from the scan is where the room has it.
#[test]
fn device_goes_back_into_the_scan() {
    let (landmarks, device) = (boot_landmarks(Side::Right), device());
    let placement = placed(Side::Right, 30.0);
    let ct_from_device = ct_from_device(&placement, &landmarks, &device);
    let room_from_ct = placement.room_from_patient * landmarks.patient_from_ct();
    let source = room_from_ct * (ct_from_device * Point3::origin());
    assert!((source - device.source()).norm() < 1e-9);
    let joint = ct_from_device.inverse() * Point3::from(landmarks.joint_centre);
    assert!(
        joint.x.abs() < 1e-9 && joint.y.abs() < 1e-9,
        "the beam passes the joint: {joint}"
    );
}

#[test]
fn impossible_placements_are_refused() {
    let (points, landmarks) = (boot(Side::Right), boot_landmarks(Side::Right));
    let with = |points: &[Point3<f32>], angle, table: &Plane| {
        place(points, &landmarks, angle, table, &device()).unwrap_err()
    };
    assert!(matches!(
        with(&points[..2], 0.0, &table()),
        PlaceError::TooFewPoints { .. }
    ));
    for degrees in [f64::NAN, 361.0] {
        let error = with(&points, f64::to_radians(degrees), &table());
        assert!(matches!(error, PlaceError::Angle(_)), "{error}");
    }
    let wall = Plane {
        normal: Vector3::x_axis(),
        offset_mm: 0.0,
    };
    assert!(matches!(
        with(&points, 0.0, &wall),
        PlaceError::BeamMissesTable
    ));
    let ceiling = Plane {
        normal: Vector3::z_axis(),
        offset_mm: 2000.0,
    };
    assert!(matches!(
        with(&points, 0.0, &ceiling),
        PlaceError::BeamMissesTable
    ));
    let high = Plane {
        normal: Vector3::z_axis(),
        offset_mm: 1010.0,
    };
    assert!(matches!(
        with(&points, 0.0, &high),
        PlaceError::AboveSource { .. }
    ));
    let mut broken = points.clone();
    broken[7].y = f32::NAN;
    assert!(matches!(
        with(&broken, 0.0, &table()),
        PlaceError::NotFinite { index: 7 }
    ));
    let mut bent = landmarks.clone();
    bent.anterior = bent.axis_direction;
    let error = place(&points, &bent, 0.0, &table(), &device()).unwrap_err();
    assert!(matches!(error, PlaceError::Axes));
    let mut across = landmarks.clone();
    across.plane_points = [[0.0, 85.0, -60.0], [10.0, 85.0, 0.0], [20.0, 85.0, 60.0]];
    let error = place(&points, &across, 0.0, &table(), &device()).unwrap_err();
    assert!(matches!(error, PlaceError::Plane(_)), "{error}");
    let thin: Vec<Point3<f32>> = (0..50)
        .map(|i| Point3::new(0.1, 0.2, 3.7) * i as f32)
        .collect();
    assert_eq!(
        with(&thin, 0.0, &table()),
        PlaceError::OneLine { found: 50 }
    );
}
