//! The analog engine and the fast engine, which convert an exposure to a radiograph.
//!
//! Fast engine, in the order of its work (docs/physics.md, "Fast engine"): ray-traced primary ([`adaptive_primary`]); first
//! collisions by importance sampling ([`collision_map`], [`first_collisions`]); single scatter by next-event estimation
//! ([`single_scatter`]) at nodes of the detector ([`adaptive_nodes`]); further collisions with splitting and Russian roulette
//! ([`later_collisions`], [`multiple_scatter`]); interpolation between nodes ([`scatter_field`]); quantum noise ([`noise`]).

mod adaptive_nodes;
mod adaptive_primary;
pub(crate) mod analog;
pub(crate) mod analog_image;
mod attenuation_basis;
mod cdf;
mod cell_walk;
mod centre_rays;
mod coarse_cells;
mod collision_map;
mod delta_tracking;
mod depth_table;
#[cfg(test)]
mod energy_balance;
mod entrance_kerma;
mod expected_image;
mod expected_scores;
pub(crate) mod exposure;
mod extrafocal_primary;
pub(crate) mod fast;
mod fast_progress;
pub(crate) mod fast_settings;
mod first_collisions;
mod grid_shadow;
mod importance;
#[cfg(test)]
mod invariance;
mod later_collisions;
mod line_scattering;
mod lines;
mod marker_shadow;
mod multiple_scatter;
mod node_grid;
pub(crate) mod noise;
mod open_beam;
mod path_tables;
mod paths;
pub(crate) mod prepared_phantom;
mod preview;
mod primary_rays;
mod primary_signal;
mod quasi_random;
pub(crate) mod raytrace;
mod rotation;
mod scatter_field;
#[cfg(test)]
mod scatter_of_a_sphere;
mod scatter_table;
mod single_scatter;
mod site;
#[cfg(test)]
pub(crate) mod small_limb;
mod spectral_quadrature;
mod trilinear;
pub(crate) mod tube_load;
mod uniform_blocks;
