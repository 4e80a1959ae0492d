//! Line integrals of a trilinear density, piece by piece between the planes through the centres of voxels.

use crate::phantom::lattice::Ray;

/// Weights, mm, of the eight corners of a cell for a piece of a ray from one length to another in that cell: the integral of
/// the density is the sum of the corner densities times their weights.
///
/// The density along a ray is a cubic in such a cell, so the two-point Gauss rule is exact. Corner x + 2 y + 4 z is on the upper side
/// of the axes whose bits are set; the ray counts cells from a corner of the lattice, and its coordinates are non-negative here.
#[inline(always)]
pub(super) fn corner_lengths(ray: &Ray, from_mm: f64, to_mm: f64) -> [f32; 8] {
    const NODE: f64 = 0.577_350_269_189_625_8; // 1/√3
    let middle_mm = 0.5 * (from_mm + to_mm);
    let half_mm = 0.5 * (to_mm - from_mm);
    let (mut first, mut second) = ([0.0_f32; 3], [0.0_f32; 3]);
    for axis in 0..3 {
        let middle = ray.origin[axis] + ray.slope[axis] * middle_mm;
        let inside = (middle - (middle as i64) as f64) as f32;
        let away = (ray.slope[axis] * (NODE * half_mm)) as f32;
        first[axis] = inside - away;
        second[axis] = inside + away;
    }
    let [first, second] = [first, second].map(|[x, y, z]| {
        let half = half_mm as f32;
        let (near, far) = (half * (1.0 - z), half * z);
        let sides = [(1.0 - y) * near, y * near, (1.0 - y) * far, y * far];
        (x, sides)
    });
    let mut lengths = [0.0; 8];
    for side in 0..4 {
        let (a, b) = (first.1[side], second.1[side]);
        let upper = first.0 * a + second.0 * b;
        lengths[2 * side] = a + b - upper;
        lengths[2 * side + 1] = upper;
    }
    lengths
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// Against 2000 midpoints, for arbitrary densities at the corners.
        #[test]
        fn lengths_integrate_a_trilinear_density_exactly(
            from in prop::array::uniform3(0.0..1.0_f64),
            to in prop::array::uniform3(0.0..1.0_f64),
            density in prop::array::uniform8(0.0..2.0_f64),
        ) {
            let (from, to) = (Vector3::from(from), Vector3::from(to));
            prop_assume!((to - from).norm() > 1e-2);
            let slope = (to - from) / 7.0;
            let cell = Vector3::new(5.0, 800.0, 31.0);
            let ray = Ray { origin: cell + from - slope * 3.0, slope };
            let lengths = corner_lengths(&ray, 3.0, 10.0);
            let found: f64 = lengths.iter().zip(density).map(|(mm, density)| f64::from(*mm) * density).sum();
            const POINTS: usize = 2_000;
            let mut expected = 0.0;
            for point in 0..POINTS {
                let at = from + (to - from) * ((point as f64 + 0.5) / POINTS as f64);
                for (corner, density) in density.into_iter().enumerate() {
                    let weight = |axis: usize| if corner >> axis & 1 == 1 { at[axis] } else { 1.0 - at[axis] };
                    expected += weight(0) * weight(1) * weight(2) * density * 7.0 / POINTS as f64;
                }
            }
            prop_assert!((found - expected).abs() < 2e-6 * 7.0 * 2.0, "{} {}", found, expected);
        }
    }
}
