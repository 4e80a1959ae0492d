//! Interaction of photons with matter: cross sections, materials, scattering.

mod composition;
pub(crate) mod compton;
pub(crate) mod cross_section_table;
pub(crate) mod cross_sections;
pub(crate) mod electron_shell;
pub(crate) mod element;
pub(crate) mod energy_nodes;
pub(crate) mod energy_range;
pub(crate) mod energy_transfer;
pub(crate) mod fluorescence;
pub(crate) mod form_factors;
pub(crate) mod impulse_approximation;
pub(crate) mod incoherent_function;
pub(crate) mod klein_nishina;
pub(crate) mod library;
pub(crate) mod material;
pub(crate) mod material_error;
mod molecular_form_factors;
mod molecular_scatter;
pub(crate) mod natural_log;
pub(crate) mod photon_tables;
pub(crate) mod rayleigh;
pub(crate) mod sampler;
pub(crate) mod scatter_density;
mod tabulated_matter;
mod thomson;
