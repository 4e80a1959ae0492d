//! Published dimensions that depend on several parameters.

use nalgebra::{Point3, Vector3};

use super::bone_points::length_mm;
use super::{LIMB, family};
use crate::lower_leg::TALUS;
use crate::*;

/// On radiographs of 120 feet (PMC5713710) metatarsal I is the shortest, of men 56.4 ± 4.4 and of women 50.1 ± 3.1 mm, and
/// the longest phalanx is the proximal one of the big toe, of men 28.0 ± 2.4 mm. A metatarsal I below 73 % or above 94 %
/// of II counts as short or long (Drez et al. 1980).
#[test]
fn metatarsals_and_phalanges_have_the_published_proportions() {
    let ordinals = ["first", "second", "third", "fourth", "fifth"];
    for (name, leg) in family().filter(|(name, _)| ["P01", "P06", "P09"].contains(&&**name)) {
        let mm = ordinals.map(|n| length_mm(&leg, &format!("{n} metatarsal")));
        let toes = leg
            .bone_names()
            .into_iter()
            .filter(|n| n.contains("phalanx"));
        let toes: Vec<f64> = toes.map(|n| length_mm(&leg, n)).collect();
        println!("{name}: metatarsals {mm:.1?}, phalanges {toes:.1?}");
        let [mean, deviation] = match leg.sex() {
            Sex::Male => [56.4, 4.4],
            Sex::Female => [50.1, 3.1],
        };
        assert!((mm[0] - mean).abs() < 2.0 * deviation, "{name}: {mm:?}");
        assert!((0.73..0.94).contains(&(mm[0] / mm[1])), "{name}: {mm:?}");
        assert!(
            toes.iter().skip(1).all(|length| *length < toes[0]),
            "{name}: {toes:?}"
        );
        // In other phantoms the heads of the metatarsals are further forward or back.
        if name == "P01" {
            assert!((mm[0] - mean).abs() < 1.0, "{mm:?}");
            assert!(mm.iter().skip(1).all(|length| *length > mm[0]), "{mm:?}");
            assert!((toes[0] - 28.0).abs() < 2.0 * 2.4, "{toes:?}");
        }
    }
}

/// The height of the dome along a line across the talus: the lowest point between its two crests is in the middle.
#[test]
fn the_groove_of_the_trochlea_is_in_the_middle_of_the_dome() {
    for (name, leg) in family() {
        let height = |medial: f64| {
            let talus = |proximal: f64| {
                let p = Point3::from(leg.mortise.point(medial, 0.0, proximal));
                leg.skeleton.distance(TALUS, &(leg.flexion() * p))
            };
            let (mut inside, mut outside) = (-12.0, 3.0);
            for _ in 0..40 {
                let middle = 0.5 * (inside + outside);
                if talus(middle) < 0.0 {
                    inside = middle
                } else {
                    outside = middle
                }
            }
            inside
        };
        let half = 0.5 * leg.parameters.trochlea_width_mm;
        let line: Vec<[f64; 2]> = (-80..=80)
            .map(|n| 0.8 * half * f64::from(n) / 80.0)
            .map(|medial| [medial, height(medial)])
            .collect();
        let highest = |side: &[[f64; 2]]| {
            let best = side.iter().max_by(|a, b| a[1].total_cmp(&b[1]));
            *best.unwrap()
        };
        let (a, b) = (highest(&line[..80]), highest(&line[81..]));
        let slope = (b[1] - a[1]) / (b[0] - a[0]);
        let depth = |p: &&[f64; 2]| a[1] + slope * (p[0] - a[0]) - p[1];
        let between = line.iter().filter(|p| (a[0]..b[0]).contains(&p[0]));
        let groove = between
            .max_by(|p, q| depth(p).total_cmp(&depth(q)))
            .unwrap();
        assert!(
            groove[0].abs() < 1.0,
            "{name}: groove at {groove:?}, crests at {a:?} and {b:?}"
        );
        let depth_mm = leg.parameters.trochlea_groove_mm;
        assert!(
            (depth(&groove) - depth_mm).abs() < 0.3 * depth_mm,
            "{name}: {}",
            depth(&groove)
        );
    }
}

/// Over 11 men and 10 women 20.7 ± 2.6 and 27.9 ± 3.0 mm (PMC1888582); plafond and medial malleolus enclose 114°, twice
/// the angle of their bisector, 57 ± 3° (PMC3117279). Means of 400 seeds within 4 standard errors, and of the table.
#[test]
fn trochlea_and_medial_malleolus_have_the_published_means() {
    let seeds: Vec<LowerLeg> = (0..400)
        .map(|n| LowerLeg::from_seed(n, Side::Right))
        .collect();
    let table: Vec<LowerLeg> = family().map(|(_, leg)| leg).collect();
    for legs in [&seeds, &table] {
        let mean = |sex: Sex, value: &dyn Fn(&LowerLeg) -> f64| {
            let of_sex: Vec<f64> = legs
                .iter()
                .filter(|leg| leg.sex() == sex)
                .map(value)
                .collect();
            of_sex.iter().sum::<f64>() / of_sex.len() as f64
        };
        let pooled = |value: &dyn Fn(&LowerLeg) -> f64| {
            (11.0 * mean(Sex::Male, value) + 10.0 * mean(Sex::Female, value)) / 21.0
        };
        let error = 4.0 / (legs.len() as f64).sqrt();
        let radius = pooled(&|leg| leg.parameters.trochlea_radius_mm);
        let width = pooled(&|leg| leg.parameters.trochlea_width_mm);
        assert!((radius - 20.7).abs() < 2.0 * error, "{radius}");
        assert!((width - 27.9).abs() < 2.5 * error, "{width}");
        let enclosed = pooled(&|leg| {
            let up = leg.flexion().isometry.rotation * Vector3::z();
            90.0 + leg.medial_facet().normal.dot(&up).asin().to_degrees()
        });
        assert!((enclosed - 114.0).abs() < 2.0 * error, "{enclosed}");
    }
    let men = LIMB.parameters;
    assert!(men.trochlea_radius_mm > 21.0 && men.trochlea_width_mm > 28.5);
}
