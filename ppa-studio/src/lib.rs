#![doc = include_str!("../README.md")]

mod case_file;
mod coarse_scan;
mod commands;
mod desk;
mod display_mesh;
mod error;
mod false_colours;
mod generation;
mod guard;
mod limb;
mod network;
mod newest;
mod opening;
mod page;
mod plan_file;
mod plan_form;
mod plan_keys;
mod pose_label;
mod routes;
mod scene;
mod server;
mod shards;
mod state;
mod stoppable;
mod studio;
mod token;
mod what_if;

pub use error::StudioError;
pub use network::Networks;
pub use opening::Opening;
pub use server::serve;
pub use studio::Studio;
