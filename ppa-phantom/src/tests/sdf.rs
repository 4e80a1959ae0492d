//! Distances to single shapes, and shapes moved and resized.

use nalgebra::{Point3, UnitQuaternion, Vector3};
use proptest::prelude::*;

use crate::loft::{End, Loft, Section};
use crate::placement::Placement;
use crate::sdf::{Cone, Plane, Shape};
use crate::smooth::smooth_min;

fn point(reach: f64) -> impl Strategy<Value = Point3<f64>> {
    [-reach..reach, -reach..reach, -reach..reach].prop_map(Point3::from)
}

proptest! {
    /// A round cone is the union of the balls between its ends.
    #[test]
    fn round_cone_is_the_nearest_of_its_balls(p in point(30.0), to in point(15.0), ra in 1.0..6.0_f64, rb in 1.0..6.0_f64) {
        let cone = Shape::round_cone([0.0; 3], ra, to.coords.into(), rb);
        let steps = 4000;
        let nearest = (0..=steps)
            .map(|n| f64::from(n) / f64::from(steps))
            .map(|t| (p.coords - to.coords * t).norm() - (ra + t * (rb - ra)))
            .fold(f64::INFINITY, f64::min);
        let distance = cone.distance(&p);
        prop_assert!(if nearest > 0.0 { (distance - nearest).abs() < 0.02 } else { distance < 0.02 },
            "{distance} against {nearest}");
    }

    /// A blend adds at most a quarter of its width, and nothing away from the seam.
    #[test]
    fn smooth_min_stays_within_a_quarter_of_the_blend(a in -20.0..20.0_f64, b in -20.0..20.0_f64, k in 0.1..10.0_f64) {
        let (sharp, smooth) = (a.min(b), smooth_min(a, b, k));
        prop_assert!(smooth <= sharp && smooth >= sharp - k / 4.0 - 1e-12);
        prop_assert!((a - b).abs() < k || smooth == sharp);
    }

    /// The surface of an ellipsoid agrees with the formula, with slope 1.
    #[test]
    fn ellipsoid_is_exact_to_first_order(direction in point(1.0), offset in -0.5..0.5_f64) {
        prop_assume!(direction.coords.norm() > 0.1);
        let semi = Vector3::new(16.0, 9.0, 12.0);
        let unit = direction.coords.normalize();
        let on_surface = unit.component_mul(&semi);
        let normal = unit.component_div(&semi).normalize();
        let ellipsoid = Shape::ellipsoid([0.0; 3], semi.into());
        let distance = ellipsoid.distance(&Point3::from(on_surface + normal * offset));
        prop_assert!((distance - offset).abs() < 0.05 * offset.abs() + 1e-9, "{distance} for {offset}");
    }
}

/// One of every shape, combined.
fn every_shape() -> Shape {
    let sections = [0.0, 30.0].map(|s| Section::ellipse(s, [1.0, 2.0], [12.0, 8.0 + 0.1 * s]));
    let turn = UnitQuaternion::from_euler_angles(0.3, -0.2, 0.5);
    let cone = Cone {
        centre: Point3::new(1.0, -2.0, -15.0),
        axis: Vector3::x_axis(),
        radius: 20.0,
        taper: 0.1,
        groove_depth: 1.0,
        groove_at: 2.0,
        crest: 9.0,
    };
    let plane = Plane {
        normal: nalgebra::Unit::new_normalize(Vector3::new(0.2, 0.5, 1.0)),
        offset: 14.0,
    };
    let axes = turn.to_rotation_matrix();
    let loft = Loft::new(
        nalgebra::Isometry3::translation(2.0, -1.0, 4.0),
        sections.to_vec(),
        End::Capped { blend: 3.0 },
        End::Open,
    );
    Shape::union(
        4.0,
        vec![
            Shape::common(2.0, vec![Shape::Cone(cone), Shape::HalfSpace(plane)]),
            Shape::turned_ellipsoid([3.0, 1.0, -4.0], [16.0, 9.0, 12.0], axes),
            Shape::Grown {
                margin: 1.5,
                shape: Box::new(Shape::block([9.0, -8.0, 2.0], [6.0, 4.0, 9.0], 2.0, axes)),
            },
            Shape::round_cone([-10.0, 0.0, 3.0], 4.0, [-18.0, 9.0, 6.0], 2.0),
            Shape::Loft(Box::new(loft)),
        ],
    )
}

proptest! {
    /// Moving and resizing a shape moves its distances and multiplies them.
    #[test]
    fn a_placed_shape_keeps_its_distances(
        p in point(40.0), shift in point(20.0), angles in point(3.0), size in 0.5..2.0_f64,
    ) {
        let turn = UnitQuaternion::from_euler_angles(angles.x, angles.y, angles.z);
        let to = Placement::from_parts(shift.coords.into(), turn, size);
        let shape = every_shape();
        let placed = shape.placed(&to);
        let (expected, found) = (size * shape.distance(&p), placed.distance(&(to * p)));
        prop_assert!((found - expected).abs() < 1e-9, "{found} for {expected}");
        prop_assert!(found > 0.0 || placed.bounds().distance(&(to * p)) == 0.0);
    }
}
