//! Spongy bone is not even: plates and struts, thicker along the load.

use nalgebra::Point3;

use super::draw::{Purpose, normal};

/// Distance between places with independent values along x, y and z of the limb; struts of an ankle run along z.
const CELL_MM: [f64; 3] = [1.6, 1.6, 4.0];

/// A smooth random field with mean 0 and standard deviation 1 over the limb, another one for every seed.
pub(super) fn texture(seed: u64, p: &Point3<f64>) -> f64 {
    let mut base = [0_i64; 3];
    let mut share = [0.0; 3];
    for axis in 0..3 {
        let place = p[axis] / CELL_MM[axis];
        base[axis] = place.floor() as i64;
        share[axis] = place - place.floor();
    }
    let (mut sum, mut square) = (0.0, 0.0);
    for corner in 0..8 {
        let (mut weight, mut index) = (1.0, 0_u64);
        for axis in 0..3 {
            let upper = corner >> axis & 1;
            weight *= if upper == 1 {
                share[axis]
            } else {
                1.0 - share[axis]
            };
            // 21 bits per axis: the lattice repeats after three kilometres.
            index = index << 21 | ((base[axis] + upper) as u64 & 0x1f_ffff);
        }
        sum += weight * normal(seed, Purpose::Texture, index);
        square += weight * weight;
    }
    sum / f64::sqrt(square)
}
