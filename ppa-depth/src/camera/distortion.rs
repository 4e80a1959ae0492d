//! The lens: from ideal to distorted image coordinates at focal length 1, and exactly back.

use nalgebra::{Matrix2, Vector2};

use crate::camera::spec::{CameraModel, CameraSpec};

/// Rational radial and tangential distortion with the disc on which it can be inverted.
#[derive(Debug, Clone)]
pub(crate) struct Distortion {
    /// k1, k2, k3.
    numerator: [f64; 3],
    /// k4, k5, k6.
    denominator: [f64; 3],
    p1: f64,
    p2: f64,
    /// Factor on the mixed tangential terms.
    mixed: f64,
    /// Largest ideal radius that the camera uses; infinite if nothing limits it.
    radius: f64,
    /// Ideal radius beyond which the lens folds over; infinite if it does not.
    fold: f64,
}

/// Largest field angle that is searched for a fold, in degrees from the optical axis.
const MAX_FIELD_DEG: f64 = 89.9;
/// Step of that search in degrees.
const FIELD_STEP_DEG: f64 = 0.05;
/// Accepted residual of the inversion at focal length 1: 5e-9 pixel at 500 pixels.
const RESIDUAL: f64 = 1e-11;

impl Distortion {
    pub(crate) fn new(spec: &CameraSpec) -> Self {
        let mut lens = Self {
            numerator: [spec.k1, spec.k2, spec.k3],
            denominator: [spec.k4, spec.k5, spec.k6],
            p1: spec.p1,
            p2: spec.p2,
            mixed: if spec.model == CameraModel::BrownConrady {
                2.0
            } else {
                1.0
            },
            radius: 0.0,
            fold: 0.0,
        };
        lens.fold = lens.fold_radius();
        lens.radius = lens.fold.min(spec.metric_radius.unwrap_or(f64::INFINITY));
        lens
    }

    /// Ideal radius beyond which the lens folds over; infinite if it does not. The metric radius plays no role.
    pub(crate) fn fold(&self) -> f64 {
        self.fold
    }

    /// Whether the ideal point lies on the disc that the camera uses.
    pub(crate) fn contains(&self, ideal: &Vector2<f64>) -> bool {
        ideal.norm() <= self.radius
    }

    /// Radial factor d(s), s = r², and its derivative by s; `None` at or beyond a pole.
    fn radial(&self, s: f64) -> Option<(f64, f64)> {
        let cubic = |[a, b, c]: [f64; 3]| {
            (
                1.0 + s * (a + s * (b + s * c)),
                a + s * (2.0 * b + 3.0 * s * c),
            )
        };
        let ((num, d_num), (den, d_den)) = (cubic(self.numerator), cubic(self.denominator));
        (den > 0.0).then(|| (num / den, (d_num * den - num * d_den) / (den * den)))
    }

    /// First radius where r·d(r²) stops growing: beyond it two directions share one pixel.
    fn fold_radius(&self) -> f64 {
        // d/dr (r d) = d + 2 s d′
        let grows = |r: f64| {
            self.radial(r * r)
                .is_some_and(|(d, d_s)| d + 2.0 * r * r * d_s > 0.0)
        };
        let steps = (MAX_FIELD_DEG / FIELD_STEP_DEG).round() as usize;
        let field = |step: usize| (step as f64 * FIELD_STEP_DEG).to_radians().tan();
        let Some(step) = (1..=steps).find(|&step| !grows(field(step))) else {
            return f64::INFINITY;
        };
        let (mut inside, mut outside) = (field(step - 1), field(step));
        for _ in 0..60 {
            let middle = 0.5 * (inside + outside);
            if grows(middle) {
                inside = middle;
            } else {
                outside = middle;
            }
        }
        inside
    }

    /// Distorted coordinates and their derivative by the ideal ones; `None` at or beyond a pole.
    pub(crate) fn distort(&self, ideal: &Vector2<f64>) -> Option<(Vector2<f64>, Matrix2<f64>)> {
        let (x, y, s) = (ideal.x, ideal.y, ideal.norm_squared());
        let (d, d_s) = self.radial(s)?;
        let (p1, p2, m) = (self.p1, self.p2, self.mixed);
        let distorted = Vector2::new(
            x * d + p2 * (s + 2.0 * x * x) + m * p1 * x * y,
            y * d + p1 * (s + 2.0 * y * y) + m * p2 * x * y,
        );
        let jacobian = Matrix2::new(
            d + 2.0 * x * x * d_s + 6.0 * p2 * x + m * p1 * y,
            2.0 * x * y * d_s + 2.0 * p2 * y + m * p1 * x,
            2.0 * x * y * d_s + 2.0 * p1 * x + m * p2 * y,
            d + 2.0 * y * y * d_s + 6.0 * p1 * y + m * p2 * x,
        );
        Some((distorted, jacobian))
    }

    /// The ideal point that [`distort`](Self::distort) takes to `distorted`, on the camera's disc.
    ///
    /// The radial part is inverted first, by bisection on the interval where it is monotone, which puts Newton's method
    /// for the whole lens on the right branch; steps are halved until they reduce the residual.
    pub(crate) fn undistort(&self, distorted: &Vector2<f64>) -> Option<Vector2<f64>> {
        let mut ideal = self.invert_radial(distorted)?;
        let residual_at = |point: &Vector2<f64>| {
            let (image, jacobian) = self.distort(point)?;
            Some((image - distorted, jacobian))
        };
        let (mut residual, mut jacobian) = residual_at(&ideal)?;
        let accepted = RESIDUAL * (1.0 + distorted.norm());
        for _ in 0..50 {
            let step = jacobian.try_inverse()? * residual;
            if step.norm() <= 1e-15 * (1.0 + ideal.norm()) {
                break;
            }
            let shorter = (0..30).find_map(|halvings| {
                let next = ideal - step * 0.5_f64.powi(halvings);
                let (next_residual, next_jacobian) = residual_at(&next)?;
                (next_residual.norm() < residual.norm()).then_some((
                    next,
                    next_residual,
                    next_jacobian,
                ))
            });
            match shorter {
                Some(better) => (ideal, residual, jacobian) = better,
                None => break, // rounding noise, or a fold: the residual below decides
            }
        }
        let inverted = residual.norm() <= accepted && jacobian.determinant() > 0.0;
        (inverted && self.contains(&ideal)).then_some(ideal)
    }

    /// Solves r·d(r²) = |distorted| for r and keeps the direction.
    fn invert_radial(&self, distorted: &Vector2<f64>) -> Option<Vector2<f64>> {
        let target = distorted.norm();
        if target == 0.0 {
            return Some(Vector2::zeros());
        }
        let image_of = |r: f64| self.radial(r * r).map(|(d, _)| r * d);
        let mut outside = if self.radius.is_finite() {
            self.radius
        } else {
            target.max(1.0)
        };
        while self.radius.is_infinite() && image_of(outside)? < target {
            outside *= 2.0;
            if outside > 1e6 {
                return None; // the model levels off before it reaches this pixel
            }
        }
        let mut inside = 0.0;
        for _ in 0..12 {
            let middle = 0.5 * (inside + outside);
            if image_of(middle)? < target {
                inside = middle;
            } else {
                outside = middle;
            }
        }
        Some(distorted * (0.5 * (inside + outside) / target))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::DepthMode;
    use proptest::prelude::*;

    proptest! {
        /// Central differences err by h² times the third derivative, far below 1e-7 here.
        #[test]
        fn the_derivative_is_that_of_the_distortion(x in -0.8..0.8_f64, y in -0.8..0.8_f64, p1 in -0.01..0.01_f64,
            p2 in -0.01..0.01_f64, early: bool) {
            let model = if early { CameraModel::Rational6Kt } else { CameraModel::BrownConrady };
            let lens = Distortion::new(&CameraSpec { model, p1, p2, ..CameraSpec::azure_kinect(DepthMode::NfovUnbinned) });
            let at = Vector2::new(x, y);
            let (_, jacobian) = lens.distort(&at).unwrap();
            let h = 1e-5;
            for axis in [Vector2::x(), Vector2::y()] {
                let image = |point: Vector2<f64>| lens.distort(&point).unwrap().0;
                let slope = (image(at + axis * h) - image(at - axis * h)) / (2.0 * h);
                prop_assert!((jacobian * axis - slope).amax() < 1e-7);
            }
        }
    }
}
