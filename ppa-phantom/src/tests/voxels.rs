//! Voxels compared with the shapes.

use nalgebra::Vector3;
use ppa_ct::Volume;

use super::{CT, LIMB};
use crate::*;

#[test]
fn partial_volume_keeps_the_mass_at_any_spacing() {
    let mass = |ct: &Volume| {
        let share: f64 = ct.hu().iter().map(|hu| f64::from(*hu) + 1000.0).sum();
        share * ct.grid().spacing_mm().product()
    };
    let fine = mass(&CT);
    for spacing_mm in [2.0, 4.0] {
        let coarse = mass(&LIMB.voxelise(spacing_mm, TableTop::Absent).unwrap());
        // The proximal cut is a full slice: up to one slice of 9000 mm² out of 2.4 litres.
        let cut = spacing_mm * 9000.0 / 2.4e6;
        assert!(
            (coarse / fine - 1.0).abs() < 0.002 + cut,
            "{} at {spacing_mm}",
            coarse / fine
        );
    }
}

/// Compared with the tissue at 10³ points inside each voxel; bones are left out, since their HU varies inside.
#[test]
fn a_voxel_at_the_skin_is_the_mean_of_the_tissues_in_it() {
    let spacing_mm = 3.0;
    let ct = LIMB.voxelise(spacing_mm, TableTop::Absent).unwrap();
    let at_skin = (0..ct.hu().len())
        .map(|index| {
            (
                index,
                ct.grid().centre(ct.grid().voxel(index).map(|v| v as f64)),
            )
        })
        .filter(|(_, centre)| LIMB.skin_distance_mm(centre).abs() < 0.8 * spacing_mm);
    let (mut count, mut square) = (0.0, 0.0);
    for (index, centre) in at_skin.step_by(97) {
        let mut mean = 0.0;
        for n in 0..1000 {
            let place =
                Vector3::new(n % 10, n / 10 % 10, n / 100).map(|i| f64::from(i) / 10.0 - 0.45);
            mean += 0.001
                * match LIMB.tissue(&(centre + place * spacing_mm)) {
                    Tissue::Air => -1000.0,
                    Tissue::Skin => 60.0,
                    Tissue::Fat => -100.0,
                    Tissue::SoftTissue => 50.0,
                    Tissue::Tendon => 85.0,
                    _ => f64::NAN,
                };
        }
        if mean.is_finite() {
            count += 1.0;
            square += (f64::from(ct.hu()[index]) - mean).powi(2);
        }
    }
    let rms = f64::sqrt(square / count);
    assert!(count > 100.0, "{count} voxels");
    // A surface misplaced by 0.05 mm changes a voxel by 0.05 / 3 of 1000 HU.
    assert!(rms < 17.0, "{rms} HU over {count} voxels");
}

#[test]
fn voxels_are_the_same_for_any_number_of_threads() {
    let with_threads = |n| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(n)
            .build()
            .unwrap();
        pool.install(|| LIMB.voxelise(4.0, TableTop::Present).unwrap())
    };
    assert_eq!(with_threads(1), with_threads(3));
}

#[test]
fn spacing_outside_the_range_is_refused() {
    for spacing_mm in [0.0, -1.0, f64::NAN, 0.1, 9.0] {
        let refusal = LIMB.voxelise(spacing_mm, TableTop::Absent).unwrap_err();
        assert!(
            refusal.to_string().contains("expected 0.25 to 8"),
            "{refusal}"
        );
    }
}

/// Refused before memory is reserved; an empty box is refused too.
#[test]
fn more_voxels_than_2_gib_hold_are_refused() {
    let centre = LIMB.truth().joint_centre;
    let around = |half_mm: f64, spacing_mm: f64| {
        let half = Vector3::repeat(half_mm);
        LIMB.voxelise_box([centre - half, centre + half], spacing_mm, TableTop::Absent)
    };
    for (half_mm, spacing_mm) in [
        (110.0, 0.25),
        (1e6, 8.0),
        (1e300, 1.0),
        (f64::INFINITY, 1.0),
    ] {
        let refusal = around(half_mm, spacing_mm).unwrap_err().to_string();
        assert!(refusal.contains("expected at most 5.4e8"), "{refusal}");
    }
    for half_mm in [-1.0, f64::NAN] {
        let refusal = around(half_mm, 1.0).unwrap_err().to_string();
        assert!(refusal.contains("empty"), "{refusal}");
    }
}
