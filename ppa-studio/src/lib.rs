#![doc = include_str!("../README.md")]

mod case_file;
mod coarse_scan;
mod commands;
mod desk;
mod display_mesh;
mod error;
mod guard;
mod newest;
mod opening;
mod page;
mod pose_label;
mod routes;
mod scene;
mod server;
mod state;
mod studio;
mod token;
mod what_if;

pub use error::StudioError;
pub use opening::Opening;
pub use server::serve;
pub use studio::Studio;
