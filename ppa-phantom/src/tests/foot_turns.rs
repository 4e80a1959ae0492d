//! Rotation of the foot relative to the leg, from the voxels of its bones alone.

use nalgebra::{Point3, Rotation3, Vector3};

use super::bone_points::{bone_voxels, long_axis};
use super::family;
use super::gauge::{Check, Gauge, SKIN_HU, within};
use crate::parameters::Parameters;
use crate::*;

const VOXEL_MM: f64 = 1.5;
/// Largest lift of a flat skin by the soft cut of the sole: a quarter of its width of 8 mm.
const SOFT_SOLE_MM: f64 = 2.0;

fn with(leg: &LowerLeg, change: impl Fn(&mut Parameters)) -> LowerLeg {
    let mut parameters = leg.parameters;
    change(&mut parameters);
    LowerLeg::new(parameters, Side::Right)
}

/// Rotation of the second metatarsal about the talocrural axis, relative to the same leg with a right angle at the ankle.
fn plantarflexion_deg(leg: &LowerLeg) -> f64 {
    let axis = leg.mortise.axis(&leg.parameters);
    let shaft = |leg: &LowerLeg| {
        let along = long_axis(&bone_voxels(leg, "second metatarsal", VOXEL_MM));
        let forward = along * -along.y.signum();
        forward - axis.scale(axis.dot(&forward))
    };
    let (at_right_angle, found) = (
        shaft(&with(leg, |p| p.plantarflexion_rad = 0.0)),
        shaft(leg),
    );
    let sine = axis.dot(&at_right_angle.cross(&found));
    sine.atan2(at_right_angle.dot(&found)).to_degrees()
}

/// Lean of the heel bone behind the talus, seen along the foot.
fn heel_lean_deg(leg: &LowerLeg) -> f64 {
    let truth = leg.truth();
    let axis = leg.mortise.axis(&leg.parameters);
    let turn = Rotation3::from_axis_angle(&axis, truth.plantarflexion_rad);
    let pivot = leg.limb_point(&truth.talocrural_centre);
    let tuberosity: Vec<Point3<f64>> = bone_voxels(leg, "calcaneus", VOXEL_MM)
        .into_iter()
        .map(|p| turn.inverse() * (p - pivot))
        .filter(|q| q.y > 28.0 * leg.parameters.size)
        .map(|q| Point3::new(q.x, 0.0, q.z))
        .collect();
    let up = long_axis(&tuberosity);
    (up.x / up.z).atan().to_degrees()
}

/// Height from the lowest skin under the heel to the lowest under the ball of the foot, along the leg.
fn slope_of_the_sole_mm(leg: &LowerLeg) -> f64 {
    let lowest = |posterior: f64| {
        let place = Point3::new(0.0, posterior, 0.0) * leg.parameters.size;
        let sole = place - Vector3::z() * leg.truth().sole_depth_mm;
        let gauge = Gauge::around(leg, &(leg.ct_from_limb * sole), [40.0, 12.0, 8.0], VOXEL_MM);
        let grid = gauge.ct.grid();
        let skin = (0..grid.len()).filter(|n| f64::from(gauge.ct.hu()[*n]) > SKIN_HU);
        skin.map(|n| {
            leg.limb_point(&grid.centre(grid.voxel(n).map(|v| v as f64)))
                .z
        })
        .fold(f64::INFINITY, f64::min)
    };
    lowest(-110.0) - lowest(36.0)
}

fn checks(leg: &LowerLeg) -> Vec<Check> {
    let truth = leg.truth();
    let upright = with(leg, |p| p.plantarflexion_rad = 0.0);
    vec![
        within(
            "sole at a right angle",
            slope_of_the_sole_mm(&upright),
            0.0,
            SOFT_SOLE_MM + VOXEL_MM,
        ),
        within(
            "plantarflexion",
            plantarflexion_deg(leg),
            truth.plantarflexion_rad.to_degrees(),
            0.5,
        ),
        within(
            "heel valgus",
            heel_lean_deg(leg),
            truth.heel_valgus_rad.to_degrees(),
            0.5,
        ),
    ]
}

#[test]
fn flexion_and_heel_valgus_are_found_in_the_bones() {
    for (name, leg) in family().filter(|(name, _)| ["P09", "P13", "P17"].contains(&&**name)) {
        let failed = checks(&leg).into_iter().filter(|check| !check.holds());
        let failed: Vec<String> = failed.map(|check| check.to_string()).collect();
        assert!(failed.is_empty(), "{name}: {failed:#?}");
    }
}
