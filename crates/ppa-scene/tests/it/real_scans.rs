//! Real limbs. They lie beside the repository, or where `PPA_SHARED` says.

use std::path::PathBuf;

use nalgebra::{Point3, Vector3};
use ppa_mesh::{Limb, LimbSettings, extract_limb};
use ppa_scene::{
    LandmarkOverrides, Landmarks, LimbKind, Plane, Side, XrayDevice, find_landmarks, place,
};

fn limb(scan: &str) -> (Limb, Landmarks) {
    let shared = std::env::var_os("PPA_SHARED").map_or_else(
        || PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared")),
        PathBuf::from,
    );
    let volume = ppa_ct::read(&shared.join("data").join(scan))
        .unwrap()
        .volume;
    let limb = extract_limb(&volume, &LimbSettings::default()).unwrap();
    let choices = LandmarkOverrides::default();
    let landmarks = find_landmarks(&volume, &limb.mesh, &limb.mask, Side::Right, &choices).unwrap();
    (limb, landmarks)
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
/// mass beside the joint must not pull the axis off it.
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

/// No ankle in these: they are placed about the middle of the limb.
#[test]
#[ignore = "needs ../shared/data"]
fn limbs_without_an_ankle() {
    for scan in [
        "knee-calf-sts028/CT_image.nii.gz",
        "knee-sts042/CT_image.nii.gz",
        "calf-couch-sts025/CT_image.nii.gz",
        "wrist-hand-sts019/dicom",
    ] {
        let (limb, landmarks) = limb(scan);
        assert_eq!(landmarks.limb, LimbKind::Other, "{scan}");
        rests_at_every_angle(&limb, &landmarks);
    }
}
