//! Rotation of a direction by scattering angle and azimuth; docs/physics.md, "Fast engine", multiple scatter.

use std::f64::consts::TAU;

use nalgebra::Vector3;

/// The unit vector at polar angle θ from `direction`, at the azimuth that `u`, uniform in [0, 1), selects.
pub(crate) fn rotated(direction: &Vector3<f64>, cos_theta: f64, u: f64) -> Vector3<f64> {
    let (sin_phi, cos_phi) = (TAU * u).sin_cos();
    let sin_theta = (1.0 - cos_theta * cos_theta).max(0.0).sqrt();
    // Orthonormal basis without a branch near the pole (Duff et al., JCGT 6(1), 2017).
    let [x, y, z] = (*direction).into();
    let sign = 1.0_f64.copysign(z);
    let a = -1.0 / (sign + z);
    let b = x * y * a;
    let first = Vector3::new(1.0 + sign * x * x * a, sign * b, -sign * x);
    let second = Vector3::new(b, sign + y * y * a, -y);
    (first * (sin_theta * cos_phi) + second * (sin_theta * sin_phi) + direction * cos_theta)
        .normalize()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rotated_directions_have_the_angle_asked_for() {
        for direction in [Vector3::z(), -Vector3::z(), Vector3::new(0.6, -0.64, 0.48)] {
            let mut mean = Vector3::zeros();
            for i in 0..8 {
                let rotated = rotated(&direction, 0.3, f64::from(i) / 8.0);
                assert!((rotated.dot(&direction) - 0.3).abs() < 1e-12);
                mean += rotated / 8.0;
            }
            // Azimuths all around: only the part along the old direction remains.
            assert!((mean - 0.3 * direction).norm() < 1e-12);
        }
    }
}
