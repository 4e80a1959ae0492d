//! Frames of a recording: bodies that tremble in front of a camera, ideal or with the errors of a sensor.

use nalgebra::{Point3, Vector3};

use crate::camera::projection::Camera;
use crate::image::{DepthError, DepthImage};
use crate::render::body::PlacedBody;
use crate::render::body_error::BodyError;
use crate::render::ideal::render;
use crate::render::sampled::Backdrop;
use crate::sensor::observe::Sensor;
use crate::sensor::spec::SensorError;
use crate::sensor::tremor::Tremor;

/// Why a frame cannot be recorded.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RecordError {
    /// A body surrounds the camera, or its pose is invalid.
    #[error("body {body}")]
    Body {
        /// Index of the body, from 0.
        body: usize,
        /// Cause.
        source: BodyError,
    },
    /// An image without a depth.
    #[error(transparent)]
    Depth(#[from] DepthError),
}

/// A camera that records trembling bodies, with nothing behind them.
pub struct Recorder {
    camera: Camera,
    /// The sensor with the backdrop that it needs.
    sensor: Option<(Sensor, Backdrop)>,
    tremor: Tremor,
    seed: u64,
}

impl Recorder {
    /// An ideal camera or one with a `sensor`; `seed` determines noise and tremor.
    ///
    /// # Errors
    /// [`SensorError`] naming the number of the tremor that is out of range.
    pub fn new(
        camera: Camera,
        sensor: Option<Sensor>,
        tremor: Tremor,
        seed: u64,
    ) -> Result<Self, SensorError> {
        tremor.check()?;
        camera.rays(); // Not at the first frame, which may be timed.
        let backdrop = |sensor| (sensor, Backdrop::new(&camera, &[]));
        let sensor = sensor.map(backdrop);
        Ok(Self {
            camera,
            sensor,
            tremor,
            seed,
        })
    }

    /// The camera.
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// The sensor, if the camera is not ideal.
    pub fn sensor(&self) -> Option<&Sensor> {
        self.sensor.as_ref().map(|(sensor, _)| sensor)
    }

    /// One frame of bodies that the tremor moves together from their poses, about `pivot`, mm in the camera's frame. It does not
    /// depend on frames recorded before.
    ///
    /// # Errors
    /// [`RecordError`] if the camera is inside a body, or if no pixel has a depth.
    pub fn frame(
        &self,
        bodies: &[PlacedBody],
        pivot: &Point3<f64>,
        frame: u64,
    ) -> Result<DepthImage, RecordError> {
        let motion = self.tremor.motion(pivot, self.seed, frame);
        let mut bodies = bodies.to_vec();
        for placed in &mut bodies {
            placed.camera_from_body = motion * placed.camera_from_body;
        }
        for (body, placed) in bodies.iter().enumerate() {
            placed
                .require_camera_outside()
                .map_err(|source| RecordError::Body { body, source })?;
        }
        let Some((sensor, backdrop)) = &self.sensor else {
            let image = render(&self.camera, &bodies);
            image.require_visible()?;
            return Ok(image);
        };
        let seen = backdrop.before(&self.camera, &bodies)?;
        let image = sensor.observe(&self.camera, &seen, self.seed, frame)?;
        image.require_measured(seen.image.valid_pixels())?;
        Ok(image)
    }
}

/// The mean of points, about which bodies tremble; the origin if there are none.
pub fn mean_point<'a>(points: impl IntoIterator<Item = &'a Point3<f32>>) -> Point3<f64> {
    let (sum, count) = points
        .into_iter()
        .fold((Vector3::zeros(), 0_u32), |(sum, count), point| {
            (sum + point.coords.cast::<f64>(), count + 1)
        });
    Point3::from(sum / f64::from(count.max(1)))
}

#[cfg(test)]
mod tests {
    use nalgebra::Isometry3;

    use super::*;
    use crate::camera::depth_mode::DepthMode;
    use crate::camera::spec::CameraSpec;
    use crate::render::body::Body;
    use crate::render::mesh_body::MeshBody;

    #[test]
    fn bodies_move_between_frames_only_if_they_tremble() {
        let corners = [[-200.0, -200.0], [200.0, -200.0], [0.0, 200.0]];
        let corners = corners.map(|[x, y]| Point3::new(x, y, 1000.0_f32));
        let body = Body::from(MeshBody::new(&corners, &[[0, 1, 2]]).unwrap());
        let placed = [PlacedBody {
            body: &body,
            camera_from_body: Isometry3::identity(),
        }];
        let frame = |shift_mm: f64, frame: u64| {
            let camera = Camera::try_from(CameraSpec::azure_kinect(DepthMode::NfovBinned)).unwrap();
            let tremor = Tremor {
                shift_mm,
                turn_deg: 0.0,
                correlation_frames: 10.0,
            };
            let recorder = Recorder::new(camera, None, tremor, 1).unwrap();
            recorder.frame(&placed, &mean_point(&corners), frame)
        };
        let still = frame(0.0, 0).unwrap();
        assert_eq!(still.max_mm(), Some(1000.0));
        assert_eq!(frame(0.0, 7).unwrap(), still);
        assert_ne!(frame(1.0, 0).unwrap(), still);
        assert_ne!(frame(1.0, 0).unwrap(), frame(1.0, 7).unwrap());
    }
}
