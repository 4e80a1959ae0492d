//! The scar of the distal growth plate of the tibia in voxels.

use nalgebra::Vector3;

use super::LIMB;
use crate::parameters::{P01, Parameters};
use crate::*;

/// Height of the densest voxel of a column above a point in the tibia, mm, and the sum over the column of the excess above the
/// values at its ends, HU mm.
fn peak(leg: &LowerLeg, [medial, posterior, proximal]: [f64; 3], voxel_mm: f64) -> [f64; 2] {
    let low = leg.mortise_point(medial, posterior, proximal) - Vector3::z() * 3.0;
    let high = low + Vector3::z() * 6.0 + Vector3::repeat(1e-6);
    let ct = leg
        .voxelise_box([low, high], voxel_mm, TableTop::Absent)
        .unwrap();
    let hu: Vec<f64> = ct.hu().iter().map(|hu| f64::from(*hu)).collect();
    let highest = (0..hu.len()).max_by(|a, b| hu[*a].total_cmp(&hu[*b]));
    let last = hu.len() - 1;
    let base = |n: usize| hu[0] + (hu[last] - hu[0]) * n as f64 / last as f64;
    let sum: f64 = (0..hu.len()).map(|n| (hu[n] - base(n)) * voxel_mm).sum();
    [-3.0 + highest.expect("voxels") as f64 * voxel_mm, sum]
}

/// 12.5 mm above the joint, 15.5 mm on top of the hump; 220 HU with a profile of 0.4 mm standard deviation sum up to 221 HU mm. The
/// density around it is not quite linear.
#[test]
fn physeal_scar_crosses_the_tibia_above_the_joint() {
    let even = Parameters {
        trabecular_texture_hu: 0.0,
        ..P01
    };
    let even = LowerLeg::new(even, Side::Right);
    for place in [[0.0, 1.0, 12.5], [9.0, -8.0, 15.5]] {
        for voxel_mm in [0.25, 1.0] {
            let [found, sum] = peak(&even, place, voxel_mm);
            println!("{place:?}: {found} mm, {sum:.0} HU mm in voxels of {voxel_mm} mm");
            assert!(found.abs() < 0.4 + 0.5 * voxel_mm, "{found}");
            assert!((sum - 221.0).abs() < 50.0, "{sum}");
        }
    }
    // With the texture of P01 it is still the densest line across the bone.
    let rows: Vec<f64> = (0..24)
        .map(|n| {
            let mean = |n: f64| {
                let places = (0..40).map(|i| [-10.0 + 0.4 * f64::from(i), 3.0]);
                let hu = places.map(|[medial, posterior]| {
                    let p = LIMB.mortise_point(medial, posterior, n);
                    let ct = LIMB.voxelise_box([p, p], 0.5, TableTop::Absent).unwrap();
                    f64::from(ct.hu()[0])
                });
                hu.sum::<f64>() / 40.0
            };
            mean(9.0 + 0.5 * f64::from(n))
        })
        .collect();
    let highest = (0..24).fold(0, |best, n| if rows[n] > rows[best] { n } else { best });
    assert!((6..=9).contains(&highest), "{rows:.0?}");
}
