//! Tests across the modules of ppa-scene.

mod boot;
mod frames;
mod landmarks;
mod placement;
mod real_scans;
mod scan;
mod soft_tissue;
mod table;
