//! Tests across the modules of ppa-scene.

mod boot;
mod family;
mod frames;
mod landmarks;
mod placement;
mod real_scans;
mod scan;
mod soft_tissue;
mod table;
