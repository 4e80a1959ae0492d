//! The Achilles tendon.

use nalgebra::Point3;

use super::family;
use crate::*;

/// Area in mm² and depth from front to back in mm of the tendon in a plane across the leg.
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

/// Where the calf is thin as where it is thick: an even cord below the skin, as large as that of P01 at the same size.
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
