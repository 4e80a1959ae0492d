//! Depth images of meshes and recorded rooms through the camera model of a real Time-of-Flight device.
//!
//! A [`CameraSpec`] is what a user writes down (JSON); [`Camera`] is the checked camera, with the exact inverse of its
//! lens distortion. A [`Body`] is a triangle mesh ([`MeshBody`]) or a cloud of oriented discs ([`SurfelBody`]), made
//! once and then placed in as many poses as needed ([`PlacedBody`]). [`render`] gives a [`DepthImage`]; [`roi_around`]
//! the square around a joint. A [`RigSpec`] holds the two cameras on an x-ray device.
//!
//! Units: millimetres, pixels. Pixel (0, 0) is the *centre* of the first pixel. Camera frame: x right, y down,
//! z forward (OpenCV). Depth is the z coordinate of the surface, not the length of the ray; 0 means that a pixel saw
//! nothing. Row-major images, first row at the top.
//!
//! Left out: the sensor (noise, flying pixels, multipath): these are ideal ranges of the surface at pixel centres.
//! Repeatable: the image depends on the scene only, whatever the number of threads.
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

mod calibration_file;
mod depth_mode;
mod field_mask;
mod opencv_yaml;
mod spec;

mod camera;
mod distortion;

mod rig;
mod rigid;

mod body;
mod mesh_body;
mod nearest;
mod surfel_body;

mod depth_buffer;
mod optics;
mod raster;
mod render;
mod single_lens;
mod triangle;

mod image;

mod atomic;
mod exr_file;
mod png_file;

mod roi;

pub use body::{Body, BodyError, PlacedBody};
pub use camera::Camera;
pub use depth_mode::DepthMode;
pub use field_mask::FieldMask;
pub use image::{DepthError, DepthImage, DepthU16};
pub use mesh_body::MeshBody;
pub use render::render;
pub use rig::{MountedCamera, RigError, RigSpec};
pub use rigid::{RigidError, isometry_from_rows, rows_from_isometry};
pub use roi::{Roi, RoiError, roi_around};
pub use spec::{CameraError, CameraModel, CameraSpec};
pub use surfel_body::SurfelBody;
