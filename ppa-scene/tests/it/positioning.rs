//! Errors of positioning: a tilted limb, a beam off the joint.

use nalgebra::{Point3, Vector3};
use ppa_scene::{
    PlaceError, PlaceSettings, Placement, Plane, Positioning, Side, SoftTissue, XrayDevice,
    ct_from_device, place_with,
};
use proptest::prelude::*;

use crate::boot::{boot, boot_landmarks};

fn device() -> XrayDevice {
    XrayDevice::overhead(1040.0, 1100.0)
}

fn placed(side: Side, angle_deg: f64, settings: &PlaceSettings) -> Result<Placement, PlaceError> {
    let (points, landmarks) = (boot(side), boot_landmarks(side));
    let table = Plane {
        normal: Vector3::z_axis(),
        offset_mm: 0.0,
    };
    let angle_rad = angle_deg.to_radians();
    place_with(&points, &landmarks, angle_rad, &table, &device(), settings)
}

fn rigid(tilt_deg: f64, beam_shift_mm: [f64; 2]) -> PlaceSettings {
    PlaceSettings {
        positioning: Positioning {
            tilt_deg,
            beam_shift_mm,
        },
        ..PlaceSettings::default()
    }
}

proptest! {
    /// The joint is at the requested distance from the beam, the limb is tipped by the requested tilt about the axis across the
    /// table, and its lowest point touches the table.
    #[test]
    fn a_limb_is_tilted_and_shifted_as_asked(
        left in any::<bool>(), angle in 0.0..90.0_f64, tilt in -45.0..45.0_f64, across in -300.0..300.0_f64, along in -300.0..300.0_f64,
    ) {
        let side = if left { Side::Left } else { Side::Right };
        let resting = placed(side, angle, &PlaceSettings::default()).unwrap();
        let placed = placed(side, angle, &rigid(tilt, [across, along])).unwrap();
        let joint = placed.room_from_patient * Point3::origin();
        prop_assert!((joint.x + across).abs() < 1e-9 && (joint.y + along).abs() < 1e-9, "joint at {joint}");
        let motion = placed.room_from_patient.isometry().rotation * resting.room_from_patient.isometry().rotation.inverse();
        let expected = Vector3::x() * tilt.to_radians();
        prop_assert!((motion.scaled_axis() - expected).norm() < 1e-9, "{} instead of {expected}", motion.scaled_axis());
        let added = placed.contact.tilt_rad - resting.contact.tilt_rad;
        prop_assert!((added - tilt.to_radians()).abs() < 1e-12);
        prop_assert!(placed.contact.gap_mm < 1e-9 && placed.contact.penetration_mm < 1e-9, "{:?}", placed.contact);
        let ct_from_device = ct_from_device(&placed, &boot_landmarks(side), &device());
        let seen = ct_from_device.inverse() * Point3::origin();
        // The device's x is the room's, its y points towards the feet.
        prop_assert!((seen.x + across).abs() < 1e-9 && (seen.y - along).abs() < 1e-9, "the device sees the joint at {seen}");
    }
}

proptest! {
    /// However it is tilted, no point of the limb ends below the table, and none is moved up or down by more than the larger depth.
    #[test]
    fn a_tilted_limb_sinks_in_no_deeper_than_asked(
        angle in 0.0..90.0_f64, tilt in -45.0..45.0_f64, distal_mm in 0.0..8.0_f64, proximal_mm in 0.0..8.0_f64,
    ) {
        let settings = PlaceSettings {
            soft_tissue: SoftTissue { distal_mm, proximal_mm },
            ..rigid(tilt, [0.0; 2])
        };
        let landmarks = boot_landmarks(Side::Right);
        let skin = boot(Side::Right);
        let placed = placed(Side::Right, angle, &settings).unwrap();
        prop_assert!(placed.contact.penetration_mm < 1e-9, "{:?}", placed.contact);
        let room_from_ct = placed.room_from_patient * landmarks.patient_from_ct();
        for (point, lies) in skin.iter().zip(placed.in_room(&skin, &landmarks)) {
            let moved = (room_from_ct * point.cast::<f64>()).z - f64::from(lies.z);
            prop_assert!(moved.abs() < distal_mm.max(proximal_mm) + 1e-3, "{moved} mm");
        }
    }
}

/// At angle 0 the boot rests on its heel and on the upper end of its shaft, 320 mm apart.
#[test]
fn a_positive_tilt_lifts_the_proximal_end() {
    let heights = |tilt_deg| {
        let placed = placed(Side::Right, 0.0, &rigid(tilt_deg, [0.0; 2])).unwrap();
        let room_from_ct = placed.room_from_patient * boot_landmarks(Side::Right).patient_from_ct();
        [-70.0, 250.0].map(|z| (room_from_ct * Point3::new(0.0, 50.0, z)).z)
    };
    let lift_mm = 320.0 * 10_f64.to_radians().sin();
    for (tilt_deg, expected) in [(10.0, [0.0, lift_mm]), (-10.0, [lift_mm, 0.0])] {
        let found = heights(tilt_deg);
        let off = found.iter().zip(&expected).map(|(a, b)| (a - b).abs());
        assert!(off.fold(0.0, f64::max) < 0.1, "{tilt_deg}: {found:?}");
    }
}

#[test]
fn only_the_end_that_rests_is_flattened() {
    let landmarks = boot_landmarks(Side::Right);
    let skin = boot(Side::Right);
    let settings = PlaceSettings {
        soft_tissue: SoftTissue {
            distal_mm: 5.0,
            proximal_mm: 5.0,
        },
        ..rigid(15.0, [0.0; 2])
    };
    let placed = placed(Side::Right, 0.0, &settings).unwrap();
    let lies = placed.in_room(&skin, &landmarks);
    let room_from_ct = placed.room_from_patient * landmarks.patient_from_ct();
    let moved = |proximal: bool| {
        let parts = skin.iter().zip(&lies);
        parts
            .filter(|(point, _)| (point.z > 100.0) == proximal)
            .map(|(point, lies)| (room_from_ct * point.cast::<f64>()).z - f64::from(lies.z))
            .map(f64::abs)
            .fold(0.0, f64::max)
    };
    assert!(moved(true) < 1e-3, "{}", moved(true));
    assert!((moved(false) - 5.0).abs() < 0.5, "{}", moved(false));
    let lowest = lies.iter().map(|p| p.z).fold(f32::INFINITY, f32::min);
    assert!(lowest.abs() < 1e-3, "{lowest}");
}

#[test]
fn values_out_of_range_are_refused() {
    for (settings, expected) in [
        (
            rigid(46.0, [0.0; 2]),
            "tilt_deg is 46 degrees, expected -45 to 45",
        ),
        (
            rigid(f64::NAN, [0.0; 2]),
            "tilt_deg is NaN degrees, expected -45 to 45",
        ),
        (
            rigid(0.0, [0.0, -301.0]),
            "beam_shift_mm is -301 mm, expected -300 to 300",
        ),
    ] {
        let error = placed(Side::Right, 0.0, &settings).unwrap_err();
        assert_eq!(error.to_string(), expected);
    }
}
