//! Measurements away from the ankle joint.

use std::f64::consts::TAU;

use nalgebra::{Point3, Vector3};

use super::gauge::{Check, Gauge, HALF_WAY_HU, SKIN_HU, within};
use crate::lower_leg::TIBIA;
use crate::parameters::Parameters;
use crate::sdf::Shape;
use crate::*;

/// The point on the tibia at a height that faces most directly away from the middle of the shaft, and its normal:
/// elsewhere the shell is cut obliquely and appears thicker.
fn facing_outwards(leg: &LowerLeg, height_mm: f64) -> (Point3<f64>, Vector3<f64>) {
    let to_tibia = |p: &Point3<f64>| leg.skeleton.distance(TIBIA, &leg.limb_point(p));
    let inside = leg.mortise_point(0.5, 0.5, height_mm);
    (0..90)
        .map(|n| f64::to_radians(4.0 * f64::from(n)))
        .map(|angle| {
            let outwards =
                leg.mortise_point(angle.cos(), angle.sin(), 0.0) - leg.mortise_point(0.0, 0.0, 0.0);
            let out = (0..400)
                .map(|n| 0.1 * f64::from(n))
                .find(|t| to_tibia(&(inside + outwards * *t)) > 0.0)
                .expect("a surface within 40 mm");
            let surface = inside + outwards * out;
            let slope = |axis| {
                let step = Vector3::ith(axis, 0.01);
                to_tibia(&(surface + step)) - to_tibia(&(surface - step))
            };
            let normal = Vector3::new(slope(0), slope(1), slope(2)).normalize();
            (normal.dot(&outwards), surface, normal)
        })
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, surface, normal)| (surface, normal))
        .expect("90 directions")
}

/// Cortex, spongy bone and girths.
pub(super) fn leg(leg: &LowerLeg, voxel_mm: f64) -> Vec<Check> {
    let truth = leg.truth();
    let size = leg.parameters.size;
    let mut checks = Vec::new();
    for [height, thickness] in truth.tibia_cortex_mm {
        let (surface, normal) = facing_outwards(leg, height);
        let gauge = Gauge::around(leg, &surface, [10.0; 3], 0.4);
        let outside = surface + normal * 1.5;
        let outer = gauge.reach(&outside, &-normal, HALF_WAY_HU, true);
        let shell = outside - normal * (outer + 0.3);
        let inner = gauge.reach(&shell, &-normal, HALF_WAY_HU, false);
        checks.push(within("cortex of the tibia", inner + 0.3, thickness, 0.4));
    }
    let metaphysis = leg.mortise_point(0.0, 0.0, 20.0 * size);
    let mean_and_deviation = |leg: &LowerLeg| {
        let gauge = Gauge::around(leg, &metaphysis, [4.0; 3], voxel_mm);
        let hu = gauge.ct.hu();
        let mean = hu.iter().map(|hu| f64::from(*hu)).sum::<f64>() / hu.len() as f64;
        let square: f64 = hu.iter().map(|hu| (f64::from(*hu) - mean).powi(2)).sum();
        [mean, (square / hu.len() as f64).sqrt()]
    };
    let [_, deviation] = mean_and_deviation(leg);
    // Texture shifts the mean of so small a box by a quarter of its deviation.
    let even = Parameters {
        trabecular_texture_hu: 0.0,
        ..leg.parameters
    };
    let [mean, _] = mean_and_deviation(&LowerLeg::new(even, leg.side()));
    // Denser towards the surface by 180 exp(-depth / 5 mm), 10 to 14 mm away.
    checks.push(within(
        "spongy bone, HU",
        mean,
        truth.trabecular_hu + 15.0,
        25.0,
    ));
    let texture = leg.parameters.trabecular_texture_hu;
    checks.push(within(
        "texture, HU",
        deviation,
        texture,
        12.0 + 0.15 * texture,
    ));

    for [height, girth] in truth.girths_mm {
        let centre = truth.joint_centre + truth.axis_direction.scale(height);
        let gauge = Gauge::around(leg, &(centre + 15.0 * Vector3::y()), [75.0, 75.0, 9.0], 1.0);
        let middle = centre + (leg.ct_from_limb * Vector3::new(-3.0, 15.0, 0.0)) * size;
        let outline: Vec<Point3<f64>> = (0..90)
            .map(|n| f64::to_radians(4.0 * f64::from(n)))
            .map(|angle| Vector3::new(angle.cos(), angle.sin(), 0.0))
            .map(|outwards| {
                let along = leg.ct_from_limb * outwards;
                middle + along * gauge.reach(&middle, &along, SKIN_HU, false)
            })
            .collect();
        let found: f64 = (0..90)
            .map(|n| (outline[n] - outline[(n + 1) % 90]).norm())
            .sum();
        // The error of a radius by one voxel.
        checks.push(within("girth", found, girth, TAU));
    }
    checks
}

/// Length, and the heads of the metatarsals.
pub(super) fn foot(leg: &LowerLeg, voxel_mm: f64) -> Vec<Check> {
    let truth = leg.truth();
    let mut checks = Vec::new();
    let size = leg.parameters.size;
    let toe = Gauge::around(
        leg,
        &(truth.toe_tip + 10.0 * Vector3::y()),
        [20.0; 3],
        voxel_mm,
    );
    let grid = toe.ct.grid();
    let skin = (0..grid.len()).filter(|n| f64::from(toe.ct.hu()[*n]) > SKIN_HU);
    let tip = skin
        .map(|n| grid.centre(grid.voxel(n).map(|v| v as f64)).y)
        .fold(f64::INFINITY, f64::min);
    let length = truth.back_plane_y_mm - tip;
    checks.push(within("foot", length, truth.foot_length_mm, voxel_mm));

    let foot = leg.ct_from_limb * leg.foot_placement.isometry;
    let forward = foot * -Vector3::y();
    let head = |name: &str| {
        let bones = leg.skeleton.bones();
        let bone = bones.iter().find(|bone| bone.name == name).unwrap();
        let Shape::Union { parts, .. } = &bone.solid else {
            panic!("a metatarsal is a union")
        };
        let Some(Shape::Ellipsoid { centre, semi, .. }) = parts.last() else {
            panic!("whose last part is the head")
        };
        let centre = leg.ct_from_limb * centre;
        let gauge = Gauge::around(leg, &centre, [16.0; 3], 0.6);
        // From outside the head; the joint in front of it is about 1.4 mm wide.
        let outside = semi.y + 0.6 * size;
        let front = outside - gauge.reach(&(centre + forward * outside), &-forward, 400.0, true);
        centre + forward * front
    };
    let second = head("second metatarsal");
    let names = ["first", "third", "fourth", "fifth"];
    let semi = [9.5, 7.7, 7.4, 7.2]; // of P01; 8.0 of the second
    for (n, ordinal) in names.into_iter().enumerate() {
        let front = head(&format!("{ordinal} metatarsal"));
        let expected = truth.metatarsal_heads_mm[n] + (semi[n] - 8.0) * size;
        let found = (front - second).dot(&forward);
        checks.push(within("head of a metatarsal", found, expected, voxel_mm));
    }
    checks
}
