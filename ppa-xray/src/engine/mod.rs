//! From an exposure to a radiograph: followed photon by photon, or fast.

mod adaptive_nodes;
mod adaptive_primary;
pub(crate) mod analog;
pub(crate) mod analog_image;
mod attenuation_basis;
mod coarse_cells;
mod collision_map;
#[cfg(test)]
mod energy_balance;
pub(crate) mod exposure;
pub(crate) mod fast;
mod first_collisions;
#[cfg(test)]
mod invariance;
mod later_collisions;
mod lines;
mod multiple_scatter;
mod node_grid;
pub(crate) mod noise;
mod outlook;
mod paths;
mod primary_rays;
mod primary_signal;
mod quasi_random;
pub(crate) mod raytrace;
mod running_sums;
mod scatter_field;
#[cfg(test)]
mod scatter_of_a_sphere;
mod scatter_table;
mod single_scatter;
#[cfg(test)]
pub(crate) mod small_limb;
mod spectral_quadrature;
mod turn;
