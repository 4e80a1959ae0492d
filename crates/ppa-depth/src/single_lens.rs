//! The lens in single precision: fast, and good to find out which pixels a triangle may cover.

use nalgebra::Vector3;

use crate::spec::{CameraModel, CameraSpec};

/// A corner in the image: column, row, and depth in mm; NaN if it is behind the camera or far outside the image.
pub(crate) type Corner = [f32; 3];

/// Projection as in [`Camera::project`](crate::Camera::project), on a disc of directions.
pub(crate) struct SingleLens {
    numerator: [f32; 3],
    denominator: [f32; 3],
    p1: f32,
    p2: f32,
    mixed: f32,
    focal: [f32; 2],
    centre: [f32; 2],
    radius_squared: f32,
}

impl SingleLens {
    /// `radius`: of the disc √((X/Z)² + (Y/Z)²).
    pub(crate) fn new(spec: &CameraSpec, radius: f64) -> Self {
        let single = |values: [f64; 3]| values.map(|value| value as f32);
        Self {
            numerator: single([spec.k1, spec.k2, spec.k3]),
            denominator: single([spec.k4, spec.k5, spec.k6]),
            p1: spec.p1 as f32,
            p2: spec.p2 as f32,
            mixed: if spec.model == CameraModel::BrownConrady {
                2.0
            } else {
                1.0
            },
            focal: [spec.fx as f32, spec.fy as f32],
            centre: [spec.cx as f32, spec.cy as f32],
            radius_squared: (radius * radius) as f32,
        }
    }

    #[inline]
    pub(crate) fn corner(&self, point: Vector3<f32>) -> Corner {
        let inverse = 1.0 / point.z;
        let (x, y) = (point.x * inverse, point.y * inverse);
        let s = x * x + y * y;
        let cubic = |[a, b, c]: [f32; 3]| 1.0 + s * (a + s * (b + s * c));
        let d = cubic(self.numerator) / cubic(self.denominator);
        let (p1, p2, xy) = (self.p1, self.p2, self.mixed * x * y);
        let u = x * d + p2 * (s + 2.0 * x * x) + p1 * xy;
        let v = y * d + p1 * (s + 2.0 * y * y) + p2 * xy;
        if point.z > 0.0 && s <= self.radius_squared {
            [
                self.focal[0] * u + self.centre[0],
                self.focal[1] * v + self.centre[1],
                point.z,
            ]
        } else {
            [f32::NAN; 3]
        }
    }
}
