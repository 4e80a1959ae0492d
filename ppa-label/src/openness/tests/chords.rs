//! Rays that cross blocks in one step give the same lengths as single steps, bit for bit.

use super::bones::Body;
use super::gap_voxels::GapVoxels;
use super::gutter::Gap;
use super::rays::{Ray, STEP_MM};
use super::*;
use proptest::prelude::*;

const SPACING_MM: f64 = 0.8;

/// A ball on either side, as tibia and fibula, and two talar ones where they leave room; 60 x 50 x 40 voxels.
fn balls(talar: [([f64; 3], f64); 2]) -> AnkleBones {
    let grid = Grid::axis_aligned(
        [60, 50, 40],
        Vector3::from_element(SPACING_MM),
        Point3::origin(),
    );
    let grid = grid.unwrap();
    let numbers = BoneNumbers::default();
    let places = [
        ([44.0, 20.0, 15.0], 4.0),
        ([3.0, 20.0, 15.0], 4.0),
        talar[0],
        talar[1],
    ];
    let bones = [numbers.tibia, numbers.fibula, numbers.talus, numbers.talus];
    let label = |index: usize| {
        let p = grid.centre(grid.voxel(index).map(|v| v as f64));
        let holds = |(centre, radius): &([f64; 3], f64)| {
            nalgebra::distance(&p, &Point3::from(*centre)) < *radius
        };
        places.iter().position(holds).map_or(0, |n| bones[n])
    };
    let labels: Vec<u8> = (0..grid.len()).map(label).collect();
    AnkleBones::new(&grid, &labels, numbers, &grid.centre([30.0, 25.0, 20.0])).unwrap()
}

fn chord_by_single_steps(ray: &Ray, bones: &AnkleBones, bodies: &[&Body], most_mm: f64) -> f64 {
    let (mut chord_mm, mut before) = (0.0, -0.5);
    for point in ray.points() {
        let values = bodies.iter().map(|body| bones.at(body, &point));
        let here = f64::from(values.fold(0.0, f32::max)) - 0.5;
        let inside = match (before >= 0.0, here >= 0.0) {
            (true, true) => 1.0,
            (false, false) => 0.0,
            _ => f64::max(before, here) / (before - here).abs(),
        };
        chord_mm += STEP_MM * inside;
        if chord_mm > most_mm {
            break;
        }
        before = here;
    }
    chord_mm
}

/// Every other step of the 150 within 30 mm of the joint.
fn path_by_single_steps(ray: &Ray, gaps: &GapVoxels) -> f64 {
    let near = ray.points().skip(75).take(150).step_by(2);
    2.0 * STEP_MM * near.filter(|p| gaps.free_voxels(p).is_none()).count() as f64
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn chords_across_blocks_are_those_of_single_steps(
        near in ([14.0..34.0, 10.0..30.0, 8.0..24.0], 5.0..14.0),
        far in ([0.0..47.0, 0.0..39.0, 0.0..31.0], 1.0..9.0),
        rays in proptest::collection::vec((0.0..6.2_f64, -1.0..1.0_f64, -12.0..12.0_f64, -9.0..9.0_f64), 40),
    ) {
        let bones = balls([near, far]);
        let joint = Point3::new(24.0, 20.0, 16.0);
        let gap = |n: f64| Gap {
            foot: joint + Vector3::new(n, 0.3 * n, -n),
            across: Vector3::new(0.0, 0.6, 0.8),
            width_mm: 2.5,
        };
        let gaps: Vec<Gap> = (-6..6).map(|n| gap(f64::from(n))).collect();
        let gaps = GapVoxels::of(&gaps, &bones);
        let [talus, tibia] = [AnkleBone::Talus, AnkleBone::Tibia].map(|bone| bones.body(bone));
        for (around, up, across, along) in rays {
            let towards = Vector3::new(around.cos(), around.sin(), up).normalize();
            let exposure = Exposure {
                source: joint + towards * 900.0,
                joint,
                across: Vector3::z().cross(&towards).normalize(),
                along: Vector3::z(),
            };
            let ray = Ray::through(&exposure, [across, along], &bones);
            for bodies in [&[talus, tibia][..], &[bones.skeleton()]] {
                for most_mm in [2.0, f64::INFINITY] {
                    let expected = chord_by_single_steps(&ray, &bones, bodies, most_mm);
                    prop_assert_eq!(ray.chord_mm(&bones, bodies, most_mm), expected);
                }
            }
            for body in [talus, tibia] {
                let meets = ray.points().any(|point| bones.at(body, &point) >= 0.5);
                prop_assert_eq!(ray.meets(&bones, body), meets);
            }
            prop_assert_eq!(ray.path_mm(&gaps), path_by_single_steps(&ray, &gaps));
        }
    }
}
