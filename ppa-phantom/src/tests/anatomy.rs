//! Bones, their gaps, and their visibility in a radiograph.

use std::collections::BTreeMap;

use nalgebra::{Point3, Rotation3, Vector3};

use super::gauge::Gauge;
use super::{CT, LIMB, VOXEL_MM, family, lattice};
use crate::*;

#[test]
fn bones_of_p01_have_the_volumes_of_a_man() {
    let step_mm = 1.7;
    let mut volume_ml: BTreeMap<&str, f64> = BTreeMap::new();
    for bone in lattice(&LIMB, step_mm).filter_map(|p| LIMB.bone(&p)) {
        *volume_ml.entry(bone).or_default() += step_mm.powi(3) / 1000.0;
    }
    assert_eq!(volume_ml.len(), 30, "{volume_ml:?}");
    // Adult men; the leg bones as far as they are in the scan.
    for (name, low, high) in [
        ("talus", 30.0, 48.0),
        ("calcaneus", 48.0, 85.0),
        ("navicular", 8.0, 16.0),
        ("cuboid", 10.0, 20.0),
        ("tibia", 130.0, 220.0),
        ("fibula", 25.0, 50.0),
        ("medial sesamoid", 0.25, 0.6),
        ("lateral sesamoid", 0.2, 0.5),
    ] {
        let ml = volume_ml[name];
        assert!((low..high).contains(&ml), "{name} of {ml} ml");
    }
}

#[test]
fn gutters_open_at_the_mortise_angle_only() {
    let gauge = Gauge::joint(&LIMB, VOXEL_MM);
    for facet in gauge.facets() {
        let bone = gauge.opening(&facet);
        let open = bone.iter().copied().fold(f64::INFINITY, f64::min);
        for closed in [0, 45] {
            assert!(bone[closed + 10] > 5.0 + open, "at {closed}: {bone:?}");
        }
    }
}

/// Shadows across the beam, 1 cm above the joint of a foot of P01's size: fibula and tibia from lateral to
/// medial, and the line of the incisura.
struct Shadows {
    fibula: [f64; 2],
    tibia: [f64; 2],
    incisura: f64,
}

impl Shadows {
    fn of(leg: &LowerLeg, internal_rotation_deg: f64) -> Self {
        let angle = -internal_rotation_deg.to_radians();
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), angle);
        let height = 10.0 * leg.parameters.size;
        let in_ct = |u: f64, v: f64| leg.ct_from_limb * (turn * Point3::new(u, v, height));
        let [mut fibula, mut tibia] = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
        let mut outline: BTreeMap<i32, f64> = BTreeMap::new();
        for n in 0..400 * 160 {
            let [u, v] = [
                0.2 * f64::from(n % 400) - 40.0,
                0.5 * f64::from(n / 400) - 40.0,
            ];
            let edges = match leg.bone(&in_ct(u, v)) {
                Some("fibula") => &mut fibula,
                Some("tibia") => {
                    let edge = outline.entry(n / 400).or_insert(u);
                    *edge = edge.min(u);
                    &mut tibia
                }
                _ => continue,
            };
            *edges = [edges[0].min(u), edges[1].max(u)];
        }
        // The line of the incisura: the most medial point of the outline between its two tubercles.
        let shift = leg.parameters.drawn().lateral_shift_mm();
        let row = |posterior: f64| {
            let size = leg.parameters.size;
            let tubercle = leg
                .mortise
                .point((-17.0 - shift) * size, posterior * size, height);
            (((turn.inverse() * Point3::from(tubercle)).y + 40.0) / 0.5) as i32
        };
        let between = outline.range(row(-11.0)..=row(10.5));
        let incisura = between.map(|(_, u)| *u).fold(f64::NEG_INFINITY, f64::max);
        Self {
            fibula,
            tibia,
            incisura,
        }
    }

    fn overlap_mm(&self) -> f64 {
        self.fibula[1] - self.tibia[0]
    }

    fn clear_space_mm(&self) -> f64 {
        self.incisura - self.fibula[1]
    }
}

/// Patil 2012, mean ± 2 SD at 0° and at 15° of internal rotation: overlap 11.2 ± 4.4 and 4.2 ± 1.7 mm, clear space 2.4 ± 1.3
/// and 4.5 ± 1.2 mm.
#[test]
fn tibiofibular_distances_are_as_published() {
    let mut off = Vec::new();
    for (name, leg) in family() {
        let [front, turned] = [0.0, 15.0].map(|angle| Shadows::of(&leg, angle));
        for (what, found, range) in [
            ("overlap", front.overlap_mm(), 2.4..20.0),
            ("overlap at 15°", turned.overlap_mm(), 0.8..7.6),
            ("clear space", front.clear_space_mm(), -0.2..5.0),
            ("clear space at 15°", turned.clear_space_mm(), 2.1..6.9),
        ] {
            println!("{name} {what}: {found:.1} mm");
            if !range.contains(&found) {
                off.push(format!("{name} {what}: {found:.1} mm"));
            }
        }
        assert!(turned.overlap_mm() < front.overlap_mm() - 1.0, "{name}");
    }
    assert!(off.is_empty(), "{off:#?}");
}

#[test]
fn length_and_girths_of_p01_are_those_of_an_adult_man() {
    let truth = LIMB.truth();
    let (mut toe, mut heel) = (f64::INFINITY, f64::NEG_INFINITY);
    let grid = CT.grid();
    for (index, hu) in CT.hu().iter().enumerate() {
        if *hu > -500.0 {
            let p = grid.centre(grid.voxel(index).map(|v| v as f64));
            toe = toe.min(p.y);
            if p.z < truth.joint_centre.z {
                heel = heel.max(p.y);
            }
        }
    }
    let foot_mm = heel - toe;
    assert!((foot_mm - truth.foot_length_mm).abs() < VOXEL_MM);
    assert!((239.0..291.0).contains(&foot_mm)); // adult men, mean ± 2 SD
    assert!((heel - truth.back_plane_y_mm).abs() < VOXEL_MM);
    let [[_, ankle], [_, calf]] = truth.girths_mm;
    assert!((200.0..265.0).contains(&ankle), "ankle girth {ankle}");
    assert!((320.0..420.0).contains(&calf), "calf girth {calf}");
}
