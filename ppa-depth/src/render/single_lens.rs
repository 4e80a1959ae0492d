//! The lens in single precision, to find candidate pixels of a triangle.

use nalgebra::{Matrix3, Point3, Vector3};

use crate::camera::spec::{CameraModel, CameraSpec};

/// A corner in the image: column, row, and depth in mm; NaN if it is behind the camera or far outside the image.
pub(crate) type Corner = [f32; 3];

/// Points that are projected at a time.
pub(crate) const LANES: usize = 8;

/// Motion from the body to the camera, in single precision.
pub(crate) struct Motion {
    pub rotation: Matrix3<f32>,
    /// Translation, mm.
    pub translation: Vector3<f32>,
}

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
    /// `radius` is that of the disc √((X/Z)² + (Y/Z)²).
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

    /// Projects at most [`LANES`] points of a body, in one pass of vector code.
    #[inline]
    pub(crate) fn corners(&self, motion: &Motion, points: &[Point3<f32>], corners: &mut [Corner]) {
        let mut lanes = [[0.0_f32; LANES]; 3];
        for (i, point) in points.iter().enumerate() {
            [lanes[0][i], lanes[1][i], lanes[2][i]] = (*point).into();
        }
        let [mut us, mut vs, mut zs] = lanes;
        let (r, t) = (&motion.rotation, &motion.translation);
        for ((u, v), z) in us.iter_mut().zip(&mut vs).zip(&mut zs) {
            let point = [*u, *v, *z];
            let along = |row: usize| {
                r[(row, 0)] * point[0] + r[(row, 1)] * point[1] + r[(row, 2)] * point[2] + t[row]
            };
            [*u, *v, *z] = self.corner([along(0), along(1), along(2)]);
        }
        for (i, corner) in corners.iter_mut().enumerate() {
            *corner = [us[i], vs[i], zs[i]];
        }
    }

    #[inline(always)]
    fn corner(&self, point: [f32; 3]) -> Corner {
        let inverse = 1.0 / point[2];
        let (x, y) = (point[0] * inverse, point[1] * inverse);
        let s = x * x + y * y;
        let cubic = |[a, b, c]: [f32; 3]| 1.0 + s * (a + s * (b + s * c));
        let d = cubic(self.numerator) / cubic(self.denominator);
        let (p1, p2, xy) = (self.p1, self.p2, self.mixed * x * y);
        let u = x * d + p2 * (s + 2.0 * x * x) + p1 * xy;
        let v = y * d + p1 * (s + 2.0 * y * y) + p2 * xy;
        let seen = (point[2] > 0.0) & (s <= self.radius_squared);
        let or_nan = |value: f32| if seen { value } else { f32::NAN };
        [
            or_nan(self.focal[0] * u + self.centre[0]),
            or_nan(self.focal[1] * v + self.centre[1]),
            or_nan(point[2]),
        ]
    }
}
