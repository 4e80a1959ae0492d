//! The skin as a signed distance.

use std::f64::consts::TAU;

use nalgebra::{Point3, Vector3};
use proptest::prelude::*;

use super::{LIMB, lattice};

fn skin_slope(p: &Point3<f64>) -> Vector3<f64> {
    let step_mm = 0.02;
    Vector3::from_fn(|axis, _| {
        let step = Vector3::ith(axis, step_mm);
        (LIMB.skin_distance_mm(&(p + step)) - LIMB.skin_distance_mm(&(p - step))) / (2.0 * step_mm)
    })
}

#[test]
fn skin_distance_has_slope_one_near_the_skin() {
    let (mut near, mut off) = (0, 0);
    for p in lattice(&LIMB, 3.1) {
        if LIMB.skin_distance_mm(&p).abs() < 4.0 {
            near += 1;
            off += usize::from((skin_slope(&p).norm() - 1.0).abs() > 0.2);
        }
    }
    assert!(near > 20_000, "{near} points near the skin");
    // Only in the creases between toes, where the nearest skin is on both sides.
    assert!(off * 25 < near, "{off} of {near} points");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]
    /// Following the distance along its gradient ends on the skin, up to the 20 % by which the slope may be
    /// off, from random points around the shank.
    #[test]
    fn skin_distance_leads_to_the_skin(
        angle in 0.0..TAU, height in -5.0..240.0_f64, start in -3.0..3.0_f64,
    ) {
        let truth = LIMB.truth();
        let axis = truth.joint_centre + truth.axis_direction.scale(height) + Vector3::new(0.0, 15.0, 0.0);
        let outwards = Vector3::new(angle.cos(), angle.sin(), 0.0);
        let (mut inside, mut outside) = (0.0, 120.0);
        for _ in 0..40 {
            let middle = 0.5 * (inside + outside);
            if LIMB.skin_distance_mm(&(axis + outwards * middle)) < 0.0 { inside = middle } else { outside = middle }
        }
        let p = axis + outwards * (inside + start);
        let (distance, slope) = (LIMB.skin_distance_mm(&p), skin_slope(&p));
        let foot = p - slope.normalize() * distance;
        prop_assert!(LIMB.skin_distance_mm(&foot).abs() < 0.05 + 0.25 * distance.abs(), "{distance} mm from {p}");
    }
}

#[test]
fn heel_and_calf_touch_the_table_and_the_ankle_does_not() {
    let truth = LIMB.truth();
    let table = |x: f64, z: f64| {
        let height = truth.joint_centre.coords + Vector3::new(x, 0.0, z);
        LIMB.skin_distance_mm(&Point3::new(height.x, truth.back_plane_y_mm, height.z))
    };
    assert!(
        (0.0..0.2).contains(&table(-3.0, -50.0)),
        "heel {}",
        table(-3.0, -50.0)
    );
    assert!(
        (0.0..0.2).contains(&table(-6.0, 200.0)),
        "calf {}",
        table(-6.0, 200.0)
    );
    assert!(table(-3.0, 30.0) > 5.0);
    for p in lattice(&LIMB, 4.0).filter(|p| p.y > truth.back_plane_y_mm) {
        assert!(LIMB.skin_distance_mm(&p) > 0.0);
    }
}
