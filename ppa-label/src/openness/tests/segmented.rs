//! Bones that were separated in the scan give the joint space of the true ones.

use rayon::prelude::*;

use super::*;
use crate::{SegmentError, SegmentedBones, segment_bones};
use ppa_phantom::{Scanner, TableTop};

/// A phantom as a scanner shows it, separated, beside its true bones.
struct Segmented {
    leg: LowerLeg,
    found: Result<SegmentedBones, SegmentError>,
}

impl Segmented {
    fn of(name: &str, spacing_mm: f64) -> Self {
        Self::with_noise(name, spacing_mm, 20.0)
    }

    fn with_noise(name: &str, spacing_mm: f64, noise_hu: f64) -> Self {
        let leg = LowerLeg::family(name, Side::Right).unwrap();
        let joint = leg.truth().joint_centre;
        let reach = Vector3::repeat(62.0);
        let within = [joint - reach, joint + reach];
        let sharp = leg.voxelise_box(within, spacing_mm, TableTop::Absent);
        let scanner = Scanner {
            blur_fwhm_mm: 0.9,
            noise_hu,
            seed: 1,
        };
        let volume = scanner.scan(&sharp.unwrap()).unwrap();
        let limb = vec![true; volume.grid().len()];
        let patient = patient(&leg.truth());
        Self {
            found: segment_bones(&volume, &limb, &patient),
            leg,
        }
    }

    /// Every bone has the voxels of the true one, and the gutters their true widths.
    fn check(self, name: &str) {
        let found = self.found.unwrap_or_else(|error| panic!("{name}: {error}"));
        let true_labels = self.leg.bone_labels(&found.grid);
        let numbers = BoneNumbers::default();
        for bone in AnkleBone::ALL {
            let is = |labels: &[u8], at: usize| labels[at] == bone.number(numbers);
            let count =
                |of: &dyn Fn(usize) -> bool| (0..found.grid.len()).filter(|&at| of(at)).count();
            let both = count(&|at| is(&found.labels, at) && is(&true_labels, at));
            let sum = count(&|at| is(&found.labels, at)) + count(&|at| is(&true_labels, at));
            let dice = 2.0 * both as f64 / sum as f64;
            println!("{name} {bone:?}: Dice {dice:.4}");
            // A surface that lies a tenth of a voxel further out takes 0.005 of the fibula.
            assert!(dice > 0.98, "{name} {bone:?}: {dice}");
        }
        let truth = self.leg.truth();
        let space = |labels: &[u8]| {
            let bones = AnkleBones::new(&found.grid, labels, numbers, &truth.joint_centre).unwrap();
            JointSpace::new(bones, &patient(&truth)).unwrap()
        };
        let [segmented, labelled] = [space(&found.labels), space(&true_labels)];
        for (of, made_mm) in [
            (
                (|s| &s.medial) as fn(&JointSpace) -> &joint_space::SeenGap,
                truth.medial_gutter_mm,
            ),
            (|s| &s.superior, truth.superior_gutter_mm),
            (|s| &s.lateral, truth.lateral_gutter_mm),
        ] {
            let mean = |s: &JointSpace| {
                let gaps = &of(s).gaps;
                gaps.iter().map(|gap| gap.width_mm).sum::<f64>() / gaps.len() as f64
            };
            // Within half a voxel: a quarter for each face.
            let (found, expected) = (mean(&segmented), mean(&labelled));
            println!(
                "{name}: gutter of {found:.2} mm, {expected:.2} by true labels, made {made_mm:.2}"
            );
            assert!(
                (found - expected).abs() < 0.4,
                "{name}: {found}, {expected}"
            );
            assert!(
                of(&segmented).gaps.len() * 10 > of(&labelled).gaps.len() * 8,
                "{name}"
            );
        }
    }
}

fn patient(truth: &Truth) -> Isometry3<f64> {
    ct_from_patient(truth.joint_centre, truth.axis_direction.into_inner())
}

/// P08 has the narrowest syndesmosis, 1.0 mm: its shafts hang together in the scan.
#[test]
fn bones_are_told_apart_where_they_hang_together() {
    Segmented::of("P08", 0.8).check("P08");
}

#[test]
#[ignore = "a minute: seventeen ankles, voxelised, scanned and segmented"]
fn bones_of_every_phantom_are_told_apart() {
    (1..=17).into_par_iter().for_each(|n| {
        let name = format!("P{n:02}");
        Segmented::of(&name, 0.8).check(&name);
    });
}

/// A sharp kernel: voxels of soft tissue pass 200 HU by noise alone, here and there.
#[test]
fn specks_of_noise_are_no_bones() {
    let [quiet, noisy] = [20.0, 60.0].map(|noise_hu| {
        let found = Segmented::with_noise("P01", 1.0, noise_hu).found.unwrap();
        found.labels.iter().copied().max().unwrap()
    });
    println!("{quiet}, {noisy}");
    assert_eq!(noisy, quiet);
}

#[test]
fn bones_that_touch_are_refused_with_the_place() {
    let segmented = Segmented::of("P03", 1.8);
    let joint = segmented.leg.truth().joint_centre;
    let Err(SegmentError::Touching {
        bones,
        area_mm2,
        at,
        ..
    }) = segmented.found
    else {
        panic!("{:?}", segmented.found.map(|found| found.grid));
    };
    println!("{bones:?} {area_mm2} {at:?}, joint {joint:?}");
    assert_eq!(bones, ["tibia", "fibula"]);
    // In the incisura: above the joint, on the right, which is where LPS x falls.
    let [x, _, z] = at;
    assert!((0.0..30.0).contains(&(z - joint.z)), "{at:?}, {joint:?}");
    assert!((8.0..30.0).contains(&(joint.x - x)), "{at:?}, {joint:?}");
}
