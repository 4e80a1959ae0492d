//! A camera whose parameters have been checked.

use std::sync::{Arc, OnceLock};

use nalgebra::{Matrix2, Point2, Point3, Vector2};
use rayon::prelude::*;

use crate::camera::distortion::Distortion;
use crate::camera::optics::Optics;
use crate::camera::spec::{CameraError, CameraSpec};

/// A checked camera: projection, its exact inverse, and the rays of its pixels.
///
/// `TryFrom<CameraSpec>` is the only constructor. Cloning is cheap: clones share the table of rays.
#[derive(Debug, Clone)]
pub struct Camera {
    spec: CameraSpec,
    distortion: Distortion,
    optics: Arc<OnceLock<Optics>>,
}

impl TryFrom<CameraSpec> for Camera {
    type Error = CameraError;

    fn try_from(spec: CameraSpec) -> Result<Self, CameraError> {
        spec.check()?;
        Ok(Self {
            distortion: Distortion::new(&spec),
            spec,
            optics: Arc::default(),
        })
    }
}

impl Camera {
    /// Parameters of the camera.
    pub fn spec(&self) -> &CameraSpec {
        &self.spec
    }

    /// Columns of the image.
    pub fn width(&self) -> u32 {
        self.spec.width
    }

    /// Rows of the image.
    pub fn height(&self) -> u32 {
        self.spec.height
    }

    /// Pixel (u, v) on which a point in the camera frame (mm) falls; it may lie outside the image.
    ///
    /// `None` for points not in front of the camera, outside its metric radius, or so far off axis that the lens model
    /// folds over.
    pub fn project(&self, point_in_camera: &Point3<f64>) -> Option<Point2<f64>> {
        self.project_with_jacobian(point_in_camera)
            .map(|(pixel, _)| pixel)
    }

    /// [`project`](Self::project), and the derivative of the pixel with respect to (X/Z, Y/Z).
    pub(crate) fn project_with_jacobian(
        &self,
        point: &Point3<f64>,
    ) -> Option<(Point2<f64>, Matrix2<f64>)> {
        if !(point.z > 0.0 && point.z.is_finite()) {
            return None;
        }
        let ideal = Vector2::new(point.x / point.z, point.y / point.z);
        if !self.distortion.contains(&ideal) {
            return None;
        }
        let (distorted, jacobian) = self.distortion.distort(&ideal)?;
        let CameraSpec { fx, fy, cx, cy, .. } = self.spec;
        let pixel = Point2::new(fx * distorted.x + cx, fy * distorted.y + cy);
        Some((
            pixel,
            Matrix2::from_diagonal(&Vector2::new(fx, fy)) * jacobian,
        ))
    }

    /// Direction (X/Z, Y/Z) that a pixel (u, v) looks along: the inverse of [`project`](Self::project) to about 1e-11.
    ///
    /// `None` outside the metric radius and where the distortion cannot be inverted; the mask is ignored.
    pub fn unproject(&self, pixel: &Point2<f64>) -> Option<Vector2<f64>> {
        let CameraSpec { fx, fy, cx, cy, .. } = self.spec;
        let distorted = Vector2::new((pixel.x - cx) / fx, (pixel.y - cy) / fy);
        if !distorted.iter().all(|value| value.is_finite()) {
            return None;
        }
        self.distortion.undistort(&distorted)
    }

    /// [`unproject`](Self::unproject) of every pixel centre, `None` outside the mask; row-major; computed on first use and
    /// cached.
    pub fn rays(&self) -> &[Option<Vector2<f64>>] {
        &self.optics().rays
    }

    pub(crate) fn optics(&self) -> &Optics {
        if let Some(optics) = self.optics.get() {
            return optics;
        }
        // Made before the cell is locked: a thread that waits for the others' rays may be handed another image of this camera.
        let width = self.spec.width;
        let rays = (0..width * self.spec.height)
            .into_par_iter()
            .map(|index| {
                let (u, v) = (index % width, index / width);
                self.unproject(&Point2::new(f64::from(u), f64::from(v)))
                    .filter(|ray| self.spec.mask.is_none_or(|mask| mask.contains(ray)))
            })
            .collect();
        let optics = Optics::new(&self.spec, &self.distortion, rays);
        self.optics.get_or_init(|| optics)
    }
}
