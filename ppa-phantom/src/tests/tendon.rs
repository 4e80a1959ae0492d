//! The Achilles tendon and the fat in front of it.

use nalgebra::{Point3, Unit, Vector3};

use super::family;
use crate::*;

/// Area in mm² and front-to-back depth in mm of the tendon in a plane across the leg.
fn section(leg: &LowerLeg, height_mm: f64) -> [f64; 2] {
    const STEP_MM: f64 = 0.4;
    let mut deepest: f64 = 0.0;
    let mut area = 0.0;
    for i in -60..=60 {
        let column = (0..150).filter(|j| {
            let [x, y] = [f64::from(i) * STEP_MM, 20.0 + f64::from(*j) * STEP_MM];
            leg.tissue_in_limb(&Point3::new(x, y, height_mm)) == Tissue::Tendon
        });
        let depth = column.count() as f64 * STEP_MM;
        area += depth * STEP_MM;
        deepest = deepest.max(depth);
    }
    [area, deepest]
}

/// For thin and thick calves: an even cord below the skin, as large as that of P01 at the same size.
#[test]
fn the_achilles_tendon_follows_the_skin() {
    let seeds = (0..12).map(|n| (format!("seed {n}"), LowerLeg::from_seed(n, Side::Right)));
    let p01 = LowerLeg::p01();
    let heights = [5.0, 15.0, 25.0, 35.0, 45.0, 60.0, 75.0];
    let expected = heights.map(|height| section(&p01, height));
    for (height, [area, depth]) in heights.iter().zip(&expected) {
        assert!(
            (25.0..90.0).contains(area) && (4.0..9.0).contains(depth),
            "{height}: {area}, {depth}"
        );
    }
    let mut off = Vec::new();
    for (name, leg) in family().chain(seeds) {
        let size = leg.parameters.size;
        for (height, [area, depth]) in heights.iter().zip(&expected) {
            let [found, deep] = section(&leg, height * size);
            let (share, deeper) = (found / (area * size * size), deep / (depth * size));
            if !(0.65..1.45).contains(&share) || !(0.7..1.4).contains(&deeper) {
                off.push(format!(
                    "{name} at {height} mm: {share:.2} of the area, {deeper:.2} of the depth"
                ));
            }
        }
    }
    assert!(off.is_empty(), "{off:#?}");
}

/// From behind towards the tibia: skin, tendon, Kager's fat of 8 to 30 mm, the deep flexors, bone.
#[test]
fn kagers_fat_lies_between_tendon_and_flexors() {
    for (name, leg) in family() {
        let size = leg.parameters.size;
        for height in [15.0, 25.0, 35.0] {
            let behind = leg.mortise_point(0.0, 0.0, height * size) + Vector3::y() * 90.0;
            let forward = Unit::new_unchecked(-Vector3::y());
            let chords = leg.chords(&behind, &forward, 120.0);
            let tendon = chords.iter().position(|c| c.tissue == Tissue::Tendon);
            let inwards = &chords[tendon.expect("a tendon") + 1..][..3];
            let tissues = [Tissue::Fat, Tissue::SoftTissue, Tissue::Cortical];
            let found: Vec<Tissue> = inwards.iter().map(|c| c.tissue).collect();
            assert_eq!(found, tissues, "{name} at {height}: {chords:?}");
            let fat_mm = inwards[0].length_mm() / size;
            assert!((8.0..30.0).contains(&fat_mm), "{name}: {fat_mm}");
        }
    }
}
