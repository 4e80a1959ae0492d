//! Monte Carlo transport of diagnostic x-rays (1–150 keV) through voxel phantoms, and the radiograph it makes.
//!
//! A [`Spectrum`] says which photons leave the source, a [`Material`] what a gram of matter does to them:
//! photoelectric absorption, Rayleigh scattering with form factors, Compton scattering with Klein–Nishina × S(q).
//!
//! Units: mm, radians, keV, g/cm³, mass attenuation in cm²/g.
//! Left out: electrons deposit where they are born, since at 150 keV they travel about 0.3 mm in water, less than a voxel;
//! fluorescence counts as absorbed; a Compton-scattered photon has the energy that a free electron at rest would leave it.
//! Repeatable: random numbers are addressed by seed and history, so the number of threads changes nothing.
//!
//! ```
//! use ppa_xray::{Filter, Material, Spectrum, TubeSpec};
//! let tube = TubeSpec { kvp: 60.0, anode_angle_deg: 12.0, filters: vec!["Al:2.5".parse()?] };
//! let spectrum = Spectrum::tungsten(&tube)?;
//! assert!((spectrum.mean_energy_kev() - 35.95).abs() < 0.36); // SpekPy 2.5.4
//! assert!(Material::named("titanium")?.total_cm2_g(36.0)? > Material::named("water")?.total_cm2_g(36.0)?);
//! # Ok::<(), ppa_xray::SpectrumError>(())
//! ```

mod compton;
mod cross_sections;
mod element;
mod library;
mod material;
mod material_error;
mod octaves;
mod philox;
mod rayleigh;
mod sampler;
mod spectrum;
mod spectrum_error;
mod spectrum_file;
mod tube;

mod analog;
mod attenuation;
mod fast;
mod hu;
mod lattice;
mod noise;
mod output;
mod presentation;
mod projection;
mod radiograph;
mod raytrace;
mod tally;
mod tracking;
mod upsample;
mod voxels;

pub use analog::{AnalogSettings, analog};
pub use cross_sections::{CrossSections, MAX_ENERGY_KEV, MIN_ENERGY_KEV};
pub use fast::{FastSettings, fast};
pub use hu::{CalibrationError, HuCalibration, Tissue};
pub use material::Material;
pub use material_error::MaterialError;
pub use output::{EXR_ATTRIBUTE, OutputError};
pub use presentation::{Presentation, PresentationError};
pub use projection::{Detector, Projection, ProjectionError};
pub use radiograph::{CategorySums, Engine, Layer, Radiograph};
pub use raytrace::primary;
pub use sampler::MaterialTables;
pub use spectrum::Spectrum;
pub use spectrum_error::SpectrumError;
pub use tally::Category;
pub use tracking::TransportError;
pub use tube::{Filter, TubeSpec};
pub use voxels::{PhantomError, VoxelPhantom};
