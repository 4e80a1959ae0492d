//! Tests across the modules of ppa-scene.

mod boot;
mod choices;
mod family;
mod frames;
mod knee;
mod landmarks;
mod measures;
mod placement;
mod positioning;
mod real_scans;
mod recorded_room;
mod reference;
mod room;
mod scan;
mod soft_tissue;
mod table;
