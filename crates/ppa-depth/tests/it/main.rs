//! The depth camera against answers that can be derived.

mod camera;
mod reference;
mod render;
mod shapes;
