//! Pictures on which a person checks a prepared limb and a placed pose.

mod canvas;
mod case_picture;
mod cut_faces;
mod limb_marks;
mod palette;
mod panel;
mod pose_picture;
mod pose_scene;
mod raster;
mod sheet;
mod skin;
mod slice;
mod view;

pub use case_picture::case_picture;
pub use pose_picture::pose_picture;
