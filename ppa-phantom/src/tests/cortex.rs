//! Thickness of cortex and subchondral plates along rays.

use nalgebra::{Point3, Unit, Vector3};

use super::{LIMB, family};
use crate::lower_leg::TALUS;
use crate::*;

/// Length of the first section of compact bone along a ray from a point outside bone.
fn first_cortex_mm(leg: &LowerLeg, from: &Point3<f64>, along: &Unit<Vector3<f64>>) -> f64 {
    let chords = leg.chords(from, along, 60.0);
    let cortex = chords.iter().find(|chord| chord.tissue == Tissue::Cortical);
    cortex.expect("bone within 60 mm").length_mm()
}

/// From the middle of the superior gutter up and down: 1.0 mm in the middle, increasing with the square of the distance to 1.5 mm
/// at the facets. The trochlea is inclined by up to 15° there.
#[test]
fn plates_of_the_ankle_thicken_towards_both_sides() {
    for (name, leg) in family().filter(|(name, _)| ["P01", "P06", "P13"].contains(&&**name)) {
        let truth = leg.truth();
        let size = leg.parameters.size;
        let half_width = 0.5 * truth.trochlea_width_mm;
        for share in [-0.6, -0.3, 0.0, 0.3, 0.6] {
            let start = leg.mortise_point(share * half_width, 0.0, 0.0);
            let expected = size * (1.0 + 0.5 * share * share);
            for sign in [1.0, -1.0] {
                let along = Unit::new_normalize(truth.axis_direction.scale(sign));
                let found = first_cortex_mm(&leg, &start, &along);
                println!("{name} at {share} to {sign}: {found:.2} for {expected:.2} mm");
                assert!(
                    (found / expected - 1.0).abs() < 0.1,
                    "{name} at {share}: {found}"
                );
            }
        }
    }
}

/// The talus has only its shell on top of its neck, and more at its dome.
#[test]
fn plates_end_where_no_bone_is_opposite() {
    let down = Unit::new_normalize(-LIMB.truth().axis_direction.into_inner());
    let [neck, dome] = [-22.0, 0.0].map(|posterior| {
        let from = LIMB.mortise_point(3.0, posterior, 0.0);
        let chords = LIMB.chords(&from, &down, 60.0);
        let bone = chords.iter().find(|chord| chord.tissue == Tissue::Cortical);
        let entry = from + down.scale(bone.expect("the talus within 60 mm").from_mm);
        let entry = LIMB.limb_point(&entry);
        LIMB.skeleton.cortex_mm(TALUS, &entry, 0.0, 0.0)
    });
    assert!((neck - 0.8).abs() < 0.03, "{neck}");
    assert!((dome - 1.02).abs() < 0.02, "{dome}");
}

/// Across the medial face of the tibia, from the middle of the shaft down to the metaphysis.
#[test]
fn cortex_of_the_tibia_thins_towards_the_joint() {
    let [near, far] = [0.0, 1.0].map(|lateral| LIMB.mortise_point(-lateral, 0.0, 0.0));
    let across = Unit::new_normalize(far - near);
    let thickness = [200.0, 150.0, 100.0, 60.0, 40.0, 25.0]
        .map(|height| first_cortex_mm(&LIMB, &LIMB.mortise_point(24.0, 2.0, height), &across));
    println!("{thickness:.2?}");
    assert!(thickness.windows(2).all(|w| w[0] > w[1]), "{thickness:?}");
    assert!(thickness[0] > 4.5 && thickness[5] < 1.5, "{thickness:?}");
}
