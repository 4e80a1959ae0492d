//! New directions of many photons.

use crate::isa::Kernel;
use crate::transport::lanes::draws::unit;
use crate::transport::lanes::flights::{Each, LANES, each};
use crate::vector_math::{greatest, sin_cos_turn};

/// A polar angle and an azimuth about the old direction.
#[derive(Debug)]
pub(super) struct ScatterAngles {
    pub cos_theta: Each<f32>,
    /// Random word of the azimuth.
    pub azimuth: Each<u32>,
}

impl ScatterAngles {
    pub fn new() -> Self {
        Self {
            cos_theta: [0.0; LANES],
            azimuth: [0; LANES],
        }
    }
}

/// Rotates directions.
pub(super) struct Rotate<'a> {
    pub angles: &'a ScatterAngles,
    pub direction: &'a mut [Each<f32>; 3],
    pub count: usize,
}

impl Kernel for Rotate<'_> {
    #[inline(always)]
    fn run(self) {
        rotate(self.angles, self.direction, self.count.min(LANES));
    }
}

#[inline(always)]
fn rotate(angles: &ScatterAngles, direction: &mut [Each<f32>; 3], count: usize) {
    for i in 0..count {
        let (sin_phi, cos_phi) = sin_cos_turn(unit(angles.azimuth[i]));
        let cos_theta = angles.cos_theta[i];
        let sin_theta = greatest((1.0 - cos_theta) * (1.0 + cos_theta), 0.0).sqrt();
        // Orthonormal basis without a branch near the pole (Duff et al., JCGT 6(1), 2017).
        let [x, y, z] = each(direction, i);
        let sign = 1.0_f32.copysign(z);
        let a = -1.0 / (sign + z);
        let b = x * y * a;
        let (u, v) = (sin_theta * cos_phi, sin_theta * sin_phi);
        let new = [
            (1.0 + sign * x * x * a) * u + b * v + x * cos_theta,
            sign * b * u + (sign + y * y * a) * v + y * cos_theta,
            z * cos_theta - sign * x * u - y * v,
        ];
        // One Newton step to restore unit length.
        let square = new[0] * new[0] + new[1] * new[1] + new[2] * new[2];
        let length = 1.5 - 0.5 * square;
        for axis in 0..3 {
            direction[axis][i] = new[axis] * length;
        }
    }
}
