//! Rigid transforms between frames, and their matrices in files.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use ppa_scene::{Ct, Patient, Plane, Rigid, RigidError, Room};
use proptest::prelude::*;

pub fn isometries() -> impl Strategy<Value = Isometry3<f64>> {
    (
        prop::array::uniform3(-3.0..3.0_f64),
        prop::array::uniform3(-2000.0..2000.0_f64),
    )
        .prop_map(|(turn, shift)| {
            let rotation = UnitQuaternion::from_scaled_axis(Vector3::from(turn));
            Isometry3::from_parts(Translation3::from(Vector3::from(shift)), rotation)
        })
}

fn points() -> impl Strategy<Value = Point3<f64>> {
    prop::array::uniform3(-2000.0..2000.0_f64).prop_map(Point3::from)
}

proptest! {
    /// A chain equals its links applied one after the other, and its inverse undoes it.
    #[test]
    fn chains_compose_and_invert(a in isometries(), b in isometries(), p in points()) {
        let room_from_patient = Rigid::<Room, Patient>::new(a);
        let patient_from_ct = Rigid::<Patient, Ct>::new(b);
        let room_from_ct = room_from_patient * patient_from_ct;
        let stepwise = room_from_patient * (patient_from_ct * p);
        prop_assert!((room_from_ct * p - stepwise).norm() < 1e-8);
        prop_assert!((room_from_ct.inverse() * (room_from_ct * p) - p).norm() < 1e-8);
    }

    /// A limb keeps its shape in any frame.
    #[test]
    fn motions_keep_distances(a in isometries(), p in points(), q in points()) {
        let rigid = Rigid::<Room, Ct>::new(a);
        prop_assert!(((rigid * p - rigid * q).norm() - (p - q).norm()).abs() < 1e-8);
    }

    /// Files keep a motion: rows, then JSON, then back.
    #[test]
    fn files_keep_motions(a in isometries(), p in points()) {
        let rigid = Rigid::<Room, Ct>::new(a);
        let text = serde_json::to_string(&rigid).unwrap();
        let back: Rigid<Room, Ct> = serde_json::from_str(&text).unwrap();
        prop_assert!((rigid * p - back * p).norm() < 1e-8);
        prop_assert_eq!(rigid.to_homogeneous_rows()[3], [0.0, 0.0, 0.0, 1.0]);
    }

    /// Distances from a plane do not depend on the frame.
    #[test]
    fn planes_move_with_their_frame(a in isometries(), p in points(), q in points(), n in points()) {
        prop_assume!(n.coords.norm() > 1.0);
        let plane = Plane::through(&q, nalgebra::Unit::new_normalize(n.coords));
        let moved = plane.transformed(&a);
        prop_assert!((plane.signed_distance(&p) - moved.signed_distance(&(a * p))).abs() < 1e-7);
        prop_assert!(plane.signed_distance(&plane.project(&p)).abs() < 1e-7);
    }
}

/// Matrices with five decimals are read without their rounding errors: distances stay.
#[test]
fn printed_matrices_are_read_as_the_nearest_motion() {
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.3, -0.8, 1.1));
    let exact = Rigid::<Room, Ct>::new(Isometry3::from_parts(Translation3::identity(), turn));
    let printed = exact
        .to_homogeneous_rows()
        .map(|row| row.map(|v| (v * 1e5).round() / 1e5));
    let read = Rigid::<Room, Ct>::try_from(printed).unwrap();
    let angle = read.isometry().rotation.angle_to(&turn);
    assert!(angle < 2e-5, "{angle}");
    let far = Point3::new(2000.0, -1000.0, 500.0);
    assert!(((read * far).coords.norm() - far.coords.norm()).abs() < 1e-9);
}

#[test]
fn matrices_that_are_not_rigid_are_refused() {
    let unit: [[f64; 4]; 4] = Rigid::<Room, Ct>::identity().into();
    let refuse = |row: usize, column: usize, value: f64| {
        let mut rows = unit;
        rows[row][column] = value;
        Rigid::<Room, Ct>::try_from(rows).unwrap_err()
    };
    assert!(
        matches!(refuse(0, 0, 1.01), RigidError::NotOrthonormal { .. }),
        "scale"
    );
    assert!(matches!(refuse(2, 2, -1.0), RigidError::Mirror), "mirror");
    assert!(matches!(refuse(3, 0, 1.0), RigidError::LastRow { .. }));
    assert!(matches!(
        refuse(1, 3, f64::NAN),
        RigidError::NotFinite { .. }
    ));
}
