//! Landmarks of the phantom: joint, axis and supporting plane.

use nalgebra::{Point3, Rotation3, Vector3};
use ppa_phantom::{LowerLeg, TableTop};
use ppa_scene::{
    AxisSource, LandmarkError, LandmarkOverrides, Landmarks, LimbKind, Plane, Side, XrayDevice,
    bump_sites, find_landmarks, place,
};

use crate::scan::{P01, Scan};

fn automatic() -> LandmarkOverrides {
    LandmarkOverrides::default()
}

/// Distance of a point from the axis of the landmarks.
fn off_axis(landmarks: &Landmarks, p: &Point3<f64>) -> f64 {
    let along = Vector3::from(landmarks.axis_direction);
    (p - Point3::from(landmarks.axis_point))
        .cross(&along)
        .norm()
}

fn degrees_between(a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
    a.cross(b).norm().atan2(a.dot(b)).to_degrees()
}

#[test]
fn ankle_and_axis_of_the_phantom_are_found() {
    let truth = LowerLeg::p01().truth();
    let landmarks = P01.find(Side::Right, &automatic()).unwrap();
    assert_eq!(landmarks.limb, LimbKind::LowerLeg);
    let joint = Point3::from(landmarks.joint_centre);
    let level = Vector3::from(landmarks.scan_direction).dot(&(joint - truth.joint_centre));
    let angle = degrees_between(&landmarks.axis_direction.into(), &truth.axis_direction);
    let aside = off_axis(&landmarks, &truth.joint_centre);
    println!("level {level:.2} mm, axis {angle:.2} degrees, {aside:.2} mm beside the joint");
    assert!(level.abs() < 3.0, "joint level {level:.2} mm off");
    assert!(angle < 1.0, "axis {angle:.2} degrees off");
    assert!(aside < 5.0, "axis passes the joint at {aside:.2} mm");
}

/// The syndesmosis of this leg is thinner than a voxel: tibia and fibula are one outline up to 65 mm above the joint.
#[test]
fn the_ankle_is_found_where_coarse_voxels_fuse_the_bones() {
    let leg = LowerLeg::from_seed(5, ppa_phantom::Side::Right);
    let scan = Scan::of(leg.voxelise(2.0, TableTop::Absent).unwrap());
    let landmarks = scan.find(Side::Right, &automatic()).unwrap();
    assert_eq!(landmarks.limb, LimbKind::LowerLeg);
    let off = Point3::from(landmarks.joint_centre) - leg.truth().joint_centre;
    assert!(off.norm() < 4.0, "joint off by {off:?}");
}

/// Rotating the whole scan by 20 degrees about any axis rotates the landmarks with it.
#[test]
fn landmarks_turn_with_the_scan_and_the_limb_still_rests() {
    let truth = LowerLeg::p01().truth();
    let table = Plane {
        normal: Vector3::z_axis(),
        offset_mm: 0.0,
    };
    let device = XrayDevice::overhead(1040.0, 1100.0);
    for turn in [[0.35, 0.0, 0.0], [-0.35, 0.0, 0.0], [0.0, 0.3, -0.15]] {
        let turn = Rotation3::from_scaled_axis(Vector3::from(turn));
        let scan = P01.turned(&turn);
        let landmarks = scan.find(Side::Right, &automatic()).unwrap();
        let joint = turn * truth.joint_centre;
        let angle = degrees_between(
            &landmarks.axis_direction.into(),
            &(turn * truth.axis_direction.into_inner()),
        );
        assert!((Point3::from(landmarks.joint_centre) - joint).norm() < 6.0);
        assert!(angle < 1.0, "axis {angle:.2} degrees off");
        for degrees in [0.0_f64, 17.5, 45.0, 90.0] {
            let angle = degrees.to_radians();
            let placed = place(&scan.skin.vertices, &landmarks, angle, &table, &device).unwrap();
            let c = placed.contact;
            assert!(c.gap_mm < 1e-6 && c.penetration_mm < 1e-6, "{c:?}");
            assert!((c.distal_mm - c.proximal_mm).abs() < 0.051, "{c:?}");
        }
    }
}

/// Π_P touches the limb at both ends and the limb lies on its front side.
#[test]
fn the_plane_lies_under_the_limb() {
    let landmarks = P01.find(Side::Right, &automatic()).unwrap();
    let patient_from_ct = landmarks.patient_from_ct();
    let plane = landmarks.plane_patient();
    let lowest = |distal: bool| {
        P01.skin
            .vertices
            .iter()
            .map(|p| patient_from_ct * p.cast::<f64>())
            .filter(|p| (p.z < 0.0) == distal)
            .map(|p| plane.signed_distance(&p))
            .fold(f64::INFINITY, f64::min)
    };
    let (heel, calf) = (lowest(true), lowest(false));
    assert!(
        (-1e-6..0.06).contains(&heel) && (-1e-6..0.06).contains(&calf),
        "{heel} {calf}"
    );
    assert!(
        plane.normal.y > 0.9 && plane.normal.x.abs() < 1e-9,
        "{plane:?}"
    );
}

/// Landmarks found from the recorded choices give the same patient frame.
#[test]
fn recorded_choices_reproduce_the_landmarks() {
    let found = P01.find(Side::Right, &automatic()).unwrap();
    let choices = LandmarkOverrides {
        axis: None,
        plane_points: None,
        ..found.open_choices(&automatic())
    };
    let again = P01.find(Side::Right, &choices).unwrap();
    let (a, b) = (found.patient_from_ct(), again.patient_from_ct());
    assert!((a.isometry().to_homogeneous() - b.isometry().to_homogeneous()).amax() < 1e-9);
    assert_eq!(found.joint_region, again.joint_region);
    let text = serde_json::to_string(&found).unwrap();
    assert!(text.contains("\"side\":\"r\""));
    let read: Landmarks = serde_json::from_str(&text).unwrap();
    let c = read.patient_from_ct();
    assert!((a.isometry().to_homogeneous() - c.isometry().to_homogeneous()).amax() < 1e-9);
}

#[test]
fn a_person_overrules_every_choice() {
    let found = P01.find(Side::Right, &automatic()).unwrap();
    let [x, y, z] = found.joint_centre;
    let plane_points = [
        [x, 85.0, z - 60.0],
        [x - 20.0, 80.0, z + 180.0],
        [x + 20.0, 80.0, z + 180.0],
    ];
    let wish = LandmarkOverrides {
        limb: Some(LimbKind::LowerLeg),
        joint_centre: Some([x + 4.0, y - 3.0, z + 5.0]),
        joint_region: Some([20.0, 50.0]),
        calf_region: Some([100.0, 120.0]),
        axis_source: Some(AxisSource::Limb),
        axis: None,
        anterior: Some([0.3, -1.0, 0.0]),
        plane_points: Some(plane_points),
    };
    let got = P01.find(Side::Left, &wish).unwrap();
    assert_eq!(got.side, Side::Left);
    assert_eq!(Some(got.joint_centre), wish.joint_centre);
    assert_eq!(off_axis(&got, &Point3::from(got.joint_centre)), 0.0);
    assert_eq!(got.joint_region.range_mm, [20.0, 50.0]);
    assert_eq!(got.calf_region.range_mm, [100.0, 120.0]);
    assert_eq!(got.axis_source, AxisSource::Limb);
    assert_eq!(Some(got.plane_points), wish.plane_points);
    assert!(got.anterior[0] > 0.2 && found.anterior[0].abs() < 0.05);
}

/// Without a joint the reference level is the middle of the limb, on request.
#[test]
fn a_calf_alone_is_another_limb_on_request() {
    let [.., nk] = P01.volume.grid().size();
    let calf = P01.slices(nk - 70..nk);
    let error = calf.find(Side::Right, &automatic()).unwrap_err();
    assert_eq!(error, LandmarkError::NoJoint);
    let text = error.to_string();
    assert!(
        text.contains("neither an ankle") && text.contains("--limb other"),
        "{text}"
    );
    let other = LandmarkOverrides {
        limb: Some(LimbKind::Other),
        ..automatic()
    };
    let landmarks = calf.find(Side::Right, &other).unwrap();
    assert_eq!(landmarks.limb, LimbKind::Other);
    let ends = [0, 69].map(|k| calf.volume.grid().centre([0.0, 0.0, f64::from(k)]).z);
    assert!((landmarks.joint_centre[2] - 0.5 * (ends[0] + ends[1])).abs() < 2.0);
    let table = Plane {
        normal: Vector3::z_axis(),
        offset_mm: 0.0,
    };
    let device = XrayDevice::overhead(1040.0, 1100.0);
    let placed = place(&calf.skin.vertices, &landmarks, 0.5, &table, &device).unwrap();
    assert!(placed.contact.penetration_mm < 1e-6 && placed.contact.gap_mm < 1e-6);
    let asked = LandmarkOverrides {
        limb: Some(LimbKind::LowerLeg),
        ..automatic()
    };
    assert_eq!(
        calf.find(Side::Right, &asked).unwrap_err(),
        LandmarkError::NoAnkle
    );
    let about = LandmarkOverrides {
        joint_centre: Some(landmarks.joint_centre),
        ..automatic()
    };
    let given = calf.find(Side::Right, &about).unwrap();
    assert_eq!(given.limb, LimbKind::Other);
    assert_eq!(given.joint_centre, landmarks.joint_centre);
}

/// Every bump site contains vertices, and medial is towards the other leg.
#[test]
fn bump_sites_reach_the_skin() {
    let landmarks = P01.find(Side::Right, &automatic()).unwrap();
    let sites = bump_sites(&landmarks);
    for site in &sites {
        let near = |p: &&Point3<f32>| (p.cast::<f64>() - site.centre).norm() < site.radius_mm;
        assert!(
            P01.skin.vertices.iter().filter(near).count() > 50,
            "{site:?}"
        );
    }
    // The patient's left, +x, is medial of a right leg.
    assert!(sites[0].centre.x > landmarks.joint_centre[0] + 30.0);
    assert!(
        sites[2].centre.y < landmarks.joint_centre[1] - 30.0,
        "anterior"
    );
}

/// A limb in one slice has no axis.
#[test]
fn a_single_slice_is_refused() {
    let mut mask = P01.mask.clone();
    let [ni, nj, nk] = P01.volume.grid().size();
    for (index, inside) in mask.iter_mut().enumerate() {
        *inside &= index / (ni * nj) == nk / 2;
    }
    let other = LandmarkOverrides {
        limb: Some(LimbKind::Other),
        ..automatic()
    };
    let side = Side::Right;
    let error = find_landmarks(&P01.volume, &P01.skin, &mask, side, &other).unwrap_err();
    assert!(matches!(error, LandmarkError::Region { .. }), "{error}");
}

#[test]
fn unusable_input_is_refused() {
    let scan = &*P01;
    let find = |mask: &[bool], overrides: &LandmarkOverrides| {
        find_landmarks(&scan.volume, &scan.skin, mask, Side::Right, overrides).unwrap_err()
    };
    let error = find(&scan.mask[1..], &automatic());
    assert!(matches!(error, LandmarkError::MaskLength { .. }), "{error}");
    let nothing = vec![false; scan.mask.len()];
    assert!(matches!(
        find(&nothing, &automatic()),
        LandmarkError::Empty { voxels: 0, .. }
    ));
    let beyond = LandmarkOverrides {
        calf_region: Some([900.0, 950.0]),
        ..automatic()
    };
    let error = find(&scan.mask, &beyond);
    assert!(
        matches!(
            error,
            LandmarkError::Region {
                name: "calf region",
                ..
            }
        ),
        "{error}"
    );
    let swapped = LandmarkOverrides {
        calf_region: Some([0.0, 20.0]),
        ..automatic()
    };
    assert!(matches!(
        find(&scan.mask, &swapped),
        LandmarkError::Region { .. }
    ));
    let along = LandmarkOverrides {
        anterior: Some([0.0, 0.0, 1.0]),
        ..automatic()
    };
    assert!(matches!(
        find(&scan.mask, &along),
        LandmarkError::AnteriorAlongAxis { angle_deg, .. } if angle_deg < 5.0
    ));
    let [x, y, z] = P01.find(Side::Right, &automatic()).unwrap().joint_centre;
    let far = LandmarkOverrides {
        joint_centre: Some([x, y, z - 440.0]),
        ..automatic()
    };
    let error = find(&scan.mask, &far);
    let far = matches!(error, LandmarkError::JointFar { distance_mm, .. } if (300.0..440.0).contains(&distance_mm));
    assert!(far, "{error}");
    for (name, joint_region, calf_region) in [
        ("joint region", [90.0, 50.0], [130.0, 200.0]),
        ("calf region", [50.0, 90.0], [130.0, f64::NAN]),
    ] {
        let regions = LandmarkOverrides {
            joint_region: Some(joint_region),
            calf_region: Some(calf_region),
            ..automatic()
        };
        let error = find(&scan.mask, &regions);
        let refused = matches!(error, LandmarkError::Region { name: found, .. } if found == name);
        assert!(refused, "{error}");
    }
    let one_line = LandmarkOverrides {
        plane_points: Some([[0.0, 85.0, -60.0], [10.0, 85.0, 0.0], [20.0, 85.0, 60.0]]),
        ..automatic()
    };
    let error = find(&scan.mask, &one_line);
    assert!(matches!(error, LandmarkError::Plane { .. }), "{error}");
    let mut torn = scan.skin.clone();
    torn.vertices[3].x = -f32::NAN;
    assert_eq!(
        find_landmarks(&scan.volume, &torn, &scan.mask, Side::Right, &automatic()).unwrap_err(),
        LandmarkError::NotFinite { vertex: 3 }
    );
    let above = LandmarkOverrides {
        plane_points: Some([
            [0.0, -900.0, 0.0],
            [-20.0, -900.0, 99.0],
            [20.0, -900.0, 99.0],
        ]),
        ..automatic()
    };
    let error = find(&scan.mask, &above);
    assert!(
        matches!(error, LandmarkError::PlaneThroughLimb { .. }),
        "{error}"
    );
}
