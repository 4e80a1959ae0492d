//! Depth images of meshes and recorded rooms through the camera model of a real Time-of-Flight device.
//!
//! A [`CameraSpec`] is the user's description (JSON); [`Camera`] is the checked camera, with the exact inverse of its
//! lens distortion. A [`Body`] is a triangle mesh ([`MeshBody`]) or a cloud of oriented discs ([`SurfelBody`]), made
//! once and then placed in as many poses as needed ([`PlacedBody`]). A mesh whose source was cut off has walls there
//! ([`MeshBody::with_walls`]). [`render`] gives a [`DepthImage`]; [`roi_around`]
//! the square around a joint. A [`RigSpec`] holds the two cameras on an x-ray device; [`JointSurface`] shows how much of a joint
//! a camera at a [`Viewpoint`] would see.
//!
//! Units: millimetres, pixels. Pixel (0, 0) is the *centre* of the first pixel. Camera frame: x right, y down,
//! z forward (OpenCV). Depth is the z coordinate of the surface, not the length of the ray; 0 means that a pixel saw
//! nothing. Row-major images, first row at the top.
//!
//! [`render`] gives ideal depths at pixel centres. [`Backdrop`] renders the static scene once, with samples inside the pixels; a [`Sensor`] turns it
//! into what a Time-of-Flight device might measure: random and systematic error, mixed pixels, invalid pixels, one bounce of light. [`Recorder`]
//! records frames with it. How close they are to a device is unknown until [`fit_noise`] has been run on a recording of it.
//!
//! Repeatable: images depend only on scene and seeds, not on the number of threads.
//!
//! ```
//! use nalgebra::{Isometry3, Point3};
//! use ppa_depth::{Body, Camera, CameraSpec, DepthMode, MeshBody, PlacedBody, render};
//!
//! // One triangle, 1 m in front of the camera.
//! let vertices = [(-200.0, -200.0), (200.0, -200.0), (0.0, 200.0)].map(|(x, y)| Point3::new(x, y, 0.0_f32));
//! let body = Body::from(MeshBody::new(&vertices, &[[0, 1, 2]])?);
//! let camera = Camera::try_from(CameraSpec::azure_kinect(DepthMode::NfovUnbinned))?;
//! let camera_from_body = Isometry3::translation(0.0, 0.0, 1000.0);
//! let image = render(&camera, &[PlacedBody { body: &body, camera_from_body }]);
//! assert_eq!(image.max_mm(), Some(1000.0));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! The same triangle in front of a wall, in three frames of a sensor while it trembles:
//!
//! ```
//! use nalgebra::{Isometry3, Point3};
//! use ppa_depth::*;
//!
//! let vertices = [(-200.0, -200.0), (200.0, -200.0), (0.0, 200.0)].map(|(x, y)| Point3::new(x, y, 0.0_f32));
//! let limb = Body::from(MeshBody::new(&vertices, &[[0, 1, 2]])?);
//! let wall = Body::from(MeshBody::new(&vertices.map(|p| p * 20.0), &[[0, 1, 2]])?);
//! let camera = Camera::try_from(CameraSpec::azure_kinect(DepthMode::NfovBinned))?;
//! let place = |body, motion: Isometry3<f64>, z_mm| PlacedBody {
//!     body,
//!     camera_from_body: motion * Isometry3::translation(0.0, 0.0, z_mm),
//! };
//! let backdrop = Backdrop::new(&camera, &[place(&wall, Isometry3::identity(), 1500.0)]);
//! let sensor = Sensor::new(SensorSpec::default(), 17)?;
//! let tremor = Tremor { shift_mm: 0.5, turn_deg: 0.1, correlation_frames: 10.0 };
//! for frame in 0..3 {
//!     let motion = tremor.motion(&Point3::new(0.0, 0.0, 1000.0), 1, frame);
//!     let seen = backdrop.before(&camera, &[place(&limb, motion, 1000.0)])?;
//!     let image = sensor.observe(&camera, &seen, 1, frame)?;
//!     assert!(image.valid_pixels() > 50_000);
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod camera;
mod compiled_with;
mod coverage;
mod image;
mod io;
mod recorder;
mod render;
mod roi;
mod sensor;

pub use ppa_core::{RigidError, Roi};

pub use camera::depth_mode::DepthMode;
pub use camera::field_mask::FieldMask;
pub use camera::projection::Camera;
pub use camera::rig::{MountedCamera, RigError, RigSpec};
pub use camera::rigid::{isometry_from_rows, rows_from_isometry};
pub use camera::spec::{CameraError, CameraModel, CameraSpec};
pub use camera::viewpoint::Viewpoint;
pub use compiled_with::compiled_with;
pub use coverage::{Coverage, CoverageError, CoverageSettings, JointSurface};
pub use image::{DepthError, DepthImage, DepthU16};
pub use io::preview::false_colour;
pub use recorder::{RecordError, Recorder, mean_point};
pub use render::body::{Body, PlacedBody};
pub use render::body_error::BodyError;
pub use render::ideal::render;
pub use render::mesh_body::MeshBody;
pub use render::sampled::{Backdrop, SampledImage};
pub use render::surfel_body::SurfelBody;
pub use render::walls::{WallDepth, WalledImage, render_before};
pub use roi::{RoiError, roi_around};
pub use sensor::fit_noise::{FitError, NoiseFit, fit_noise};
pub use sensor::observe::Sensor;
pub use sensor::spec::{
    Invalidation, MixedPixels, Multipath, RandomError, SensorError, SensorSpec, SystematicError,
};
pub use sensor::tremor::Tremor;
