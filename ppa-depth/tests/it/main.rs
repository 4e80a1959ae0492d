//! The depth camera against derived answers.

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
