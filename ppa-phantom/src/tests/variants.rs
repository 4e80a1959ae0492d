//! Left and right, plate, labels, scanner, seeds, and the knee.

use nalgebra::{Point3, Unit, Vector3};
use ppa_ct::Volume;

use super::{LIMB, family};
use crate::parameters::{P01, Parameters};
use crate::*;

/// P01 to P17 span the published range, and the fixed table contains P01 unchanged.
#[test]
fn the_family_has_published_sexes_and_mortise_angles() {
    let legs: Vec<LowerLeg> = family().map(|(_, leg)| leg).collect();
    let men = legs.iter().filter(|leg| leg.sex() == Sex::Male).count();
    assert_eq!((men, legs.len()), (9, 17));
    let mut angles: Vec<f64> = legs
        .iter()
        .map(|leg| leg.truth().mortise_angle_rad.to_degrees())
        .collect();
    let mean = angles.iter().sum::<f64>() / 17.0;
    angles.sort_by(f64::total_cmp);
    assert!((angles[0] - 10.0).abs() < 1e-9 && (angles[16] - 29.0).abs() < 1e-9);
    assert!(angles.windows(2).all(|w| w[1] - w[0] > 0.4), "{angles:?}");
    assert!((mean - 19.1).abs() < 1.3, "{mean}"); // 19.1 ± 5.0 of 128 feet, standard error of 17
    assert_eq!(legs[0].parameters, P01);
    let row = LowerLeg::family("p01", Side::Left).unwrap().parameters;
    assert!((row.trochlea_width_mm / P01.trochlea_width_mm - 1.0).abs() < 0.021);
}

#[test]
fn other_names_are_refused() {
    for name in ["", "P0", "P1", "P00", "P18", "Q01", "P001", "P+1", "P-1"] {
        let refusal = LowerLeg::family(name, Side::Right)
            .map(drop)
            .expect_err(name);
        assert!(refusal.to_string().contains("P01 to P17"), "{refusal}");
    }
}

/// Means over 400 seeds within 4 standard errors, 1e-4 false alarms each; no value beyond two standard deviations.
#[test]
fn seeds_draw_dimensions_around_the_published_means() {
    let legs: Vec<LowerLeg> = (0..400)
        .map(|seed| LowerLeg::from_seed(seed, Side::Right))
        .collect();
    for (sex, size, mortise_deg) in [
        (Sex::Male, [1.0, 0.046], [21.2, 4.6]),
        (Sex::Female, [0.893, 0.041], [16.4, 4.1]),
    ] {
        let of_sex: Vec<&LowerLeg> = legs.iter().filter(|leg| leg.sex() == sex).collect();
        let n = of_sex.len() as f64;
        assert!((n - 200.0).abs() < 4.0 * 10.0, "{n} of {sex:?}");
        let sizes: Vec<f64> = of_sex.iter().map(|leg| leg.parameters.size).collect();
        let angle = |leg: &&LowerLeg| leg.truth().mortise_angle_rad.to_degrees();
        let angles: Vec<f64> = of_sex.iter().map(angle).collect();
        // Truncation at 10 and 29 degrees moves the mean by at most a fifteenth of the deviation.
        for (values, [mean, deviation]) in [(sizes, size), (angles, mortise_deg)] {
            let found = values.iter().sum::<f64>() / n;
            assert!(
                (found - mean).abs() < 4.0 * 0.88 * deviation / n.sqrt(),
                "{found}"
            );
            let reach = |v: &f64| (v - mean).abs() <= 2.0 * deviation + 1e-9;
            assert!(values.iter().all(reach));
        }
    }
    let again = LowerLeg::from_seed(7, Side::Right);
    assert_eq!(again.parameters, legs[7].parameters);
}

#[test]
fn mortise_angles_of_all_seeds_lie_between_10_and_29_degrees() {
    for seed in 0..1000 {
        for side in [Side::Right, Side::Left] {
            let angle = LowerLeg::from_seed(seed, side).parameters.mortise_angle_rad;
            let angle = angle.to_degrees();
            assert!(
                (10.0 - 1e-9..29.0 + 1e-9).contains(&angle),
                "seed {seed}: {angle}"
            );
        }
    }
    for (n, side) in (1..=17).flat_map(|n| [(n, Side::Right), (n, Side::Left)]) {
        let leg = LowerLeg::family(&format!("P{n:02}"), side).unwrap();
        let angle = leg.parameters.mortise_angle_rad.to_degrees();
        assert!(
            (10.0 - 1e-9..29.0 + 1e-9).contains(&angle),
            "P{n:02} {side:?}: {angle}"
        );
    }
}

/// Spongy bone of one shape with the seeds of several phantoms: equally dense on average, different everywhere.
#[test]
fn every_phantom_has_spongy_bone_of_its_own() {
    let shape = LowerLeg::family("P02", Side::Right).unwrap().parameters;
    let legs = [
        LowerLeg::family("P02", Side::Right).unwrap(),
        LowerLeg::family("P02", Side::Left).unwrap(),
        LowerLeg::family("P03", Side::Right).unwrap(),
        LowerLeg::from_seed(2, Side::Right),
        LowerLeg::from_seed(3, Side::Right),
    ];
    let spongy = |texture_seed: u64, trabecular_texture_hu: f64| -> Vec<f64> {
        let leg = LowerLeg::new(
            Parameters {
                texture_seed,
                trabecular_texture_hu,
                ..shape
            },
            Side::Right,
        );
        let middle = leg.mortise_point(0.0, 0.0, 18.0);
        let half = Vector3::repeat(6.0);
        let ct = leg.voxelise_box([middle - half, middle + half], 0.8, TableTop::Absent);
        ct.unwrap().hu().iter().map(|hu| f64::from(*hu)).collect()
    };
    let even = spongy(0, 0.0);
    let fields: Vec<Vec<f64>> = legs
        .iter()
        .map(|leg| spongy(leg.parameters.texture_seed, 50.0))
        .map(|hu| hu.iter().zip(&even).map(|(hu, even)| hu - even).collect())
        .collect();
    for (n, a) in fields.iter().enumerate() {
        for b in &fields[n + 1..] {
            let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
            let alike = product(a, b) / (product(a, a) * product(b, b)).sqrt();
            // The number of independent values is the number of cells of the coarse octaves in the box, about 100.
            assert!(alike.abs() < 4.0 / 100.0_f64.sqrt(), "{alike}");
        }
    }
}

/// Voxels, tissues, rays and truth of the mirror image of P01, which has no variation between sides.
#[test]
fn a_left_limb_is_the_mirror_image() {
    let left = LowerLeg::new(P01, Side::Left);
    let mirror = |p: Point3<f64>| Point3::new(-p.x, p.y, p.z);
    let (a, b) = (
        LIMB.voxelise(3.0, TableTop::Present).unwrap(),
        left.voxelise(3.0, TableTop::Present).unwrap(),
    );
    let [nx, ny, nz] = a.grid().size();
    assert_eq!(b.grid().size(), [nx, ny, nz]);
    for voxel in [
        [0, 0, 0],
        [nx / 2, ny / 2, nz / 2],
        [nx / 3, ny / 2, nz / 4],
    ] {
        let [i, j, k] = voxel;
        let other = [nx - 1 - i, j, k];
        let [p, q] = [(&a, voxel), (&b, other)]
            .map(|(ct, voxel): (&Volume, _)| ct.grid().centre(voxel.map(|v| v as f64)));
        assert!((mirror(p) - q).norm() < 1e-9, "{p} and {q}");
        assert_eq!(LIMB.tissue(&p), left.tissue(&q));
    }
    for (index, hu) in a.hu().iter().enumerate() {
        let [i, j, k] = a.grid().voxel(index);
        assert_eq!(*hu, b.at([nx - 1 - i, j, k]));
    }
    let (right, truth) = (LIMB.truth(), left.truth());
    assert_eq!(mirror(right.joint_centre), truth.joint_centre);
    assert_eq!(mirror(right.toe_tip), truth.toe_tip);
    assert_eq!(right.girths_mm, truth.girths_mm);
    let origin = right.joint_centre - Vector3::new(-12.0, 300.0, 3.0);
    let along = Unit::new_normalize(Vector3::new(-0.05, 1.0, 0.02));
    let mirrored = Unit::new_unchecked(mirror(along.into_inner().into()).coords);
    let chords = LIMB.chords(&origin, &along, 600.0);
    assert!(chords.len() > 5);
    assert_eq!(chords, left.chords(&mirror(origin), &mirrored, 600.0));
}

/// A box whose corners are voxels of the full volume has the same voxels, on either side.
#[test]
fn a_box_shows_the_same_values_as_the_whole() {
    for side in [Side::Right, Side::Left] {
        let leg = LowerLeg::family("P05", side).unwrap();
        let whole = leg.voxelise(2.5, TableTop::Present).unwrap();
        let middle = whole.grid().voxel_from_ct() * leg.truth().joint_centre;
        let low = [0, 1, 2].map(|axis| middle[axis] as usize - [9, 8, 7][axis]);
        let high = [0, 1, 2].map(|axis| middle[axis] as usize + [6, 10, 11][axis]);
        let part = whole.crop(low, high).unwrap();
        let [first, last] =
            [low, high.map(|n| n - 1)].map(|voxel| whole.grid().centre(voxel.map(|v| v as f64)));
        // Slightly larger, so that rounding loses no voxel; the start of the box is exact.
        let more = Vector3::repeat(1e-6);
        let (mut from, mut to) = (first, last + more);
        if side == Side::Left {
            (from.x, to.x) = (from.x - 1e-6, last.x);
        }
        let found = leg
            .voxelise_box([from, to], 2.5, TableTop::Present)
            .unwrap();
        assert_eq!(found.grid().size(), part.grid().size());
        let off = found.grid().centre([0.0; 3]) - part.grid().centre([0.0; 3]);
        assert!(off.norm() < 1e-9, "{off}");
        let bone = part.hu().iter().filter(|hu| **hu > 300.0).count();
        assert!(bone > 500, "{bone} voxels of bone");
        for (index, (a, b)) in found.hu().iter().zip(part.hu().iter()).enumerate() {
            assert!((a - b).abs() < 0.01, "{side:?} {index}: {a} and {b}");
        }
    }
}

#[test]
fn the_left_limb_of_a_phantom_differs_by_about_a_percent() {
    for name in ["P01", "P08", "P17"] {
        let [r, l] =
            [Side::Right, Side::Left].map(|side| LowerLeg::family(name, side).unwrap().parameters);
        for (right, left) in [
            (r.size, l.size),
            (r.trochlea_radius_mm, l.trochlea_radius_mm),
            (r.mortise_angle_rad, l.mortise_angle_rad),
        ] {
            let off = (left / right - 1.0).abs();
            assert!(0.0 < off && off < 0.021, "{name}: {right} and {left}");
        }
    }
}

#[test]
fn labels_name_the_bone_at_every_voxel() {
    let ct = LIMB.voxelise(4.0, TableTop::Absent).unwrap();
    let (labels, names) = (LIMB.bone_labels(ct.grid()), LIMB.bone_names());
    assert_eq!((labels.len(), names.len()), (ct.hu().len(), 30));
    for (index, label) in labels.iter().enumerate() {
        let p = ct.grid().centre(ct.grid().voxel(index).map(|v| v as f64));
        let name = label.checked_sub(1).map(|n| names[usize::from(n)]);
        assert_eq!(name, LIMB.bone(&p));
    }
    let labelled = names
        .iter()
        .zip(1..)
        .filter(|(_, n)| labels.contains(n))
        .count();
    assert!(labelled > 20, "{labelled} bones at 4 mm");
}
