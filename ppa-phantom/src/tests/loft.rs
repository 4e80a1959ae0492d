//! Lofts compared with bodies whose distance is known.

use std::f64::consts::TAU;

use nalgebra::{Isometry3, Point3};
use proptest::prelude::*;

use crate::loft::{End, Loft, Section};

/// A loft whose circles grow by `slope` per mm is a cone.
fn cone(slope: f64) -> Loft {
    let sections = (0..6)
        .map(|n| 20.0 * f64::from(n))
        .map(|s| Section::polar(s, [1.0, -2.0], &[10.0 + slope * s; 12]))
        .collect();
    Loft::new(
        Isometry3::translation(3.0, 0.0, 0.0),
        sections,
        End::Open,
        End::Open,
    )
}

proptest! {
    #[test]
    fn a_loft_of_growing_circles_is_a_cone(
        slope in -0.05..0.4_f64, angle in 0.0..TAU, s in 25.0..75.0_f64, offset in -3.0..3.0_f64,
    ) {
        let radius = 10.0 + slope * s;
        let steepness = slope.hypot(1.0);
        // Off the surface along its normal; the loft is moved by -3 in x.
        let (rho, z) = (radius + offset / steepness, s - offset * slope / steepness);
        let p = Point3::new(-2.0 + rho * angle.cos(), -2.0 + rho * angle.sin(), z);
        let distance = cone(slope).distance(&p);
        prop_assert!((distance - offset).abs() < 1e-6, "{distance} for {offset}");
    }

    #[test]
    fn polygon_sections_pass_through_the_grown_edges(t in 0.1..0.9_f64, offset in -2.0..2.0_f64) {
        let corners = [[-20.0, -10.0], [20.0, -10.0], [20.0, 10.0], [-20.0, 10.0]];
        let sections = [0.0, 50.0].map(|s| Section::polygon(s, &corners, 4.0)).to_vec();
        let slab = Loft::new(Isometry3::identity(), sections, End::Open, End::Open);
        let p = Point3::new(-20.0 + 40.0 * t, 14.0 + offset, 25.0);
        let distance = slab.distance(&p);
        prop_assert!((distance - offset).abs() < 0.25, "{distance} for {offset}");
    }
}

#[test]
fn a_capped_end_is_where_its_section_lies() {
    let sections = [0.0, 30.0]
        .map(|s| Section::ellipse(s, [0.0; 2], [12.0, 8.0]))
        .to_vec();
    let end = End::Capped { blend: 4.0 };
    let loft = Loft::new(Isometry3::identity(), sections, end, End::Open);
    assert!((loft.distance(&Point3::new(0.0, 0.0, -5.0)) - 5.0).abs() < 1e-9);
    assert!(loft.distance(&Point3::new(0.0, 0.0, 500.0)) < -7.0);
    assert!((loft.distance(&Point3::new(12.0, 0.0, 15.0))).abs() < 1e-9);
}
