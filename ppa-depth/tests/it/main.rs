//! The depth camera against answers that can be derived.

mod bad_surfaces;
mod calibration;
mod camera;
mod cameras;
mod coverage;
mod mixed_pixels;
mod noise_fit;
mod obliquity;
mod reference;
mod render;
mod sensor;
mod shapes;
mod surfels;
mod tremor;
mod walls;
mod watertight;
