//! Real limbs, stored next to the repository or in the folder `PPA_SHARED`.

use std::path::PathBuf;

use nalgebra::{Point3, Vector3};
use ppa_mesh::{Limb, LimbSettings, extract_limb};
use ppa_scene::{
    Joint, LandmarkError, LandmarkOverrides, Landmarks, LimbKind, Plane, Side, XrayDevice,
    find_landmarks, place,
};

fn limb(scan: &str) -> (Limb, Landmarks) {
    let (limb, found) = tried(scan, None);
    (limb, found.unwrap())
}

fn tried(scan: &str, kind: Option<LimbKind>) -> (Limb, Result<Landmarks, LandmarkError>) {
    let shared = std::env::var_os("PPA_SHARED").map_or_else(
        || PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared")),
        PathBuf::from,
    );
    let volume = ppa_ct::read(&shared.join("data").join(scan))
        .unwrap()
        .volume;
    let limb = extract_limb(&volume, &LimbSettings::default()).unwrap();
    let choices = LandmarkOverrides {
        limb: kind,
        ..LandmarkOverrides::default()
    };
    let found = find_landmarks(&volume, &limb.mesh, &limb.mask, Side::Right, &choices);
    (limb, found)
}

fn rests_at_every_angle(limb: &Limb, landmarks: &Landmarks) {
    let table = Plane {
        normal: Vector3::z_axis(),
        offset_mm: 0.0,
    };
    let device = XrayDevice::overhead(1040.0, 1100.0);
    for degrees in (0..=90).step_by(5) {
        let angle = f64::from(degrees).to_radians();
        let placed = place(&limb.mesh.vertices, landmarks, angle, &table, &device).unwrap();
        let c = placed.contact;
        assert!(
            c.gap_mm < 1e-6 && c.penetration_mm < 1e-6,
            "{degrees}: {c:?}"
        );
        assert!(
            (c.distal_mm - c.proximal_mm).abs() < 0.051,
            "{degrees}: {c:?}"
        );
    }
}

/// Read off the slices by eye: the gap lies in the slice at 201 mm, with the plafond's plate one
/// slice (3.27 mm) above and the talar dome's below; its middle is at (−45, 12) within 4 mm. The
/// mass next to the joint must not pull the axis off it.
#[test]
#[ignore = "needs ../shared/data/lower-leg-ankle-sts049"]
fn ankle_of_a_swollen_leg() {
    let (limb, landmarks) = limb("lower-leg-ankle-sts049/dicom");
    assert_eq!(landmarks.limb, LimbKind::LowerLeg);
    let joint = Point3::from(landmarks.joint_centre);
    assert!((joint.z - 201.4).abs() < 3.3, "{joint}");
    assert!(
        (joint.coords.xy() - nalgebra::Vector2::new(-45.0, 12.0)).norm() < 4.0,
        "{joint}"
    );
    rests_at_every_angle(&limb, &landmarks);
}

/// Unit vector, `ct` frame, of an angle from the scan's front (−y) towards the patient's left (+x).
fn front_turned(degrees: f64) -> Vector3<f64> {
    let (sin, cos) = degrees.to_radians().sin_cos();
    Vector3::new(sin, -cos, 0.0)
}

/// Read off axial, coronal and sagittal slices by eye. The gap lies 0.7 slices (of 3.27 mm) below slice 50 under the medial
/// and 0.3 slices below it under the lateral condyle, z = 561 to 562.5 mm; the plateau reaches from x = 38 to 104 mm and from
/// y = −75 to −40 mm. Behind the condyles a line runs 10 degrees from the scan's x axis, the medial one farther back. The
/// kneecap is cut by the front face, the calf is inclined by 22 degrees.
#[test]
#[ignore = "needs ../shared/data/knee-calf-sts028"]
fn knee_above_a_calf() {
    for scan in ["knee-calf-sts028/CT_image.nii.gz", "knee-calf-sts028/dicom"] {
        let (limb, landmarks) = limb(scan);
        println!("{landmarks:#?}");
        assert_eq!(landmarks.limb, LimbKind::Knee);
        let off = Point3::from(landmarks.joint_centre) - Point3::new(70.5, -57.0, 561.5);
        assert!(off.norm() < 5.0, "joint off by {off:?}");
        assert!(off.z.abs() < 2.5, "joint level {:.1} mm off", off.z);
        let front = Vector3::from(landmarks.anterior);
        let flat = Vector3::new(front.x, front.y, 0.0);
        let turned = flat.angle(&front_turned(-10.0)).to_degrees();
        assert!(turned < 4.0, "front {turned:.1} degrees off");
        // Through the middle of the tibia in slices 10 and 35.
        let shaft = Vector3::new(9.1, -32.5, 81.75).normalize();
        let lean = shaft
            .angle(&Vector3::from(landmarks.axis_direction))
            .to_degrees();
        assert!(lean < 2.5, "axis {lean:.1} degrees from the tibia's");
        rests_at_every_angle(&limb, &landmarks);
    }
}

/// As above. The medial condyle and a quarter of the plateau are cut by the side face. The gap lies at slice 5.4 under the medial, 6.8 under
/// the lateral condyle, z = 596 to 601 mm; the notch between them is centred at x = 91 mm, the plateau reaches from
/// y = 20 to 66 mm. Too little of the tibia is visible for an axis.
#[test]
#[ignore = "needs ../shared/data/knee-sts042"]
fn knee_below_a_thigh() {
    let (limb, landmarks) = limb("knee-sts042/CT_image.nii.gz");
    println!("{landmarks:#?}");
    assert_eq!(landmarks.limb, LimbKind::Knee);
    let off = Point3::from(landmarks.joint_centre) - Point3::new(91.0, 43.0, 598.5);
    assert!(off.norm() < 6.0, "joint off by {off:?}");
    assert!(off.z.abs() < 3.3, "joint level {:.1} mm off", off.z);
    let [found] = &landmarks.joints[..] else {
        panic!("{:?}", landmarks.joints)
    };
    assert!(found.lines.as_ref().unwrap().plateau_is_cut);
    // Through the middle of the femur in slices 30 and 46.
    let shaft = Vector3::new(3.0, -6.0, 52.3).normalize();
    let lean = shaft
        .angle(&Vector3::from(landmarks.axis_direction))
        .to_degrees();
    assert!(lean < 3.0, "axis {lean:.1} degrees from the femur's");
    rests_at_every_angle(&limb, &landmarks);
}

/// A request for one joint is refused if the scan shows the other; the error names the joint found, its place, and a remedy.
#[test]
#[ignore = "needs ../shared/data"]
fn the_other_joint_is_refused_with_its_place() {
    for (scan, asked, found, place) in [
        (
            "knee-calf-sts028/CT_image.nii.gz",
            LimbKind::LowerLeg,
            Joint::Knee,
            [70.5, -57.0, 561.5],
        ),
        (
            "knee-sts042/CT_image.nii.gz",
            LimbKind::LowerLeg,
            Joint::Knee,
            [91.0, 43.0, 598.5],
        ),
        (
            "lower-leg-ankle-sts049/dicom",
            LimbKind::Knee,
            Joint::Ankle,
            [-45.0, 12.0, 201.4],
        ),
    ] {
        let error = tried(scan, Some(asked)).1.unwrap_err();
        let LandmarkError::OtherJoint {
            found: other,
            at_mm,
            ..
        } = &error
        else {
            panic!("{scan}: {error}")
        };
        assert_eq!(*other, found, "{scan}");
        let off = Point3::from(*at_mm) - Point3::from(place);
        assert!(off.norm() < 6.0, "{scan}: {error}");
    }
}

/// A wrist, and calves without ankle or knee, are posed on request only.
#[test]
#[ignore = "needs ../shared/data"]
fn limbs_without_ankle_and_knee_are_refused_unless_asked_for() {
    for scan in [
        "calf-couch-sts025/CT_image.nii.gz",
        "two-calves-sts032/CT_image.nii.gz",
        "wrist-hand-sts019/dicom",
    ] {
        for (asked, expected) in [
            (None, LandmarkError::NoJoint),
            (Some(LimbKind::LowerLeg), LandmarkError::NoAnkle),
            (Some(LimbKind::Knee), LandmarkError::NoKnee),
        ] {
            assert_eq!(tried(scan, asked).1.unwrap_err(), expected, "{scan}");
        }
        let (limb, landmarks) = tried(scan, Some(LimbKind::Other));
        let landmarks = landmarks.unwrap();
        assert_eq!(landmarks.limb, LimbKind::Other, "{scan}");
        rests_at_every_angle(&limb, &landmarks);
    }
}

/// Neither a trunk nor a pelvis has a knee or an ankle.
#[test]
#[ignore = "needs ../shared/data"]
fn trunks_have_no_joint() {
    for scan in [
        "abdomen-arms-j2k/dicom",
        "pelvis-metal-int32/example_ct.nii.gz",
    ] {
        assert_eq!(
            tried(scan, None).1.unwrap_err(),
            LandmarkError::NoJoint,
            "{scan}"
        );
    }
}
