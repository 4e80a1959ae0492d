//! The depth camera against answers that can be derived.

mod calibration;
mod camera;
mod reference;
mod render;
mod sensor;
mod shapes;
