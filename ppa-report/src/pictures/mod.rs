//! Pictures for checking a prepared limb and a placed pose.

mod canvas;
mod case_picture;
mod cut_faces;
mod limb_marks;
mod palette;
mod panel;
mod picture_file;
mod pose_picture;
mod pose_scene;
mod raster;
mod sheet;
mod skin;
mod slice;
#[cfg(test)]
mod tests;
mod view;

pub use case_picture::case_picture;
pub use picture_file::write_picture;
pub use pose_picture::{PosedLimb, pose_picture};
