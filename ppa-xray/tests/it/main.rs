//! Tests of the public interface, some against reference data outside the repository.

mod attenuation;
mod beer_lambert;
mod case_a;
mod dose;
mod dqe;
#[cfg(feature = "dicom")]
mod dx;
mod exposure;
mod exposure_index;
mod fast_engine;
mod files;
mod gains;
mod interpolation;
mod marker;
mod mcgpu;
mod mcgpu_scans;
mod molecular_scatter;
mod noise_power;
mod placement;
mod runs;
mod scattering;
mod scenes;
mod shared;
mod spectra;
mod stationary_grid;
mod statistics;
mod tg195;
mod threads;
mod transport;
