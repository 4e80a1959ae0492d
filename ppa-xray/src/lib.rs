//! Monte Carlo transport of diagnostic x-rays (5–150 keV) through voxel phantoms, and the resulting radiographs.
//!
//! A [`Spectrum`] gives the photons that leave the source, a [`Material`] their interactions with matter:
//! photoelectric absorption, Rayleigh scattering with form factors, Compton scattering off bound and moving electrons
//! (or, by [`ComptonModel`], Klein–Nishina × S(q)). By [`FormFactors`], Rayleigh scattering follows measured form factors of tissues.
//! A [`VoxelPhantom`] is the patient, a [`Projection`] the exposure. Two engines compute a [`Radiograph`] from them:
//! [`analog`] follows every photon; [`fast`] ray-traces the primary, estimates the scatter, and adds the noise of the
//! exposure given in the settings. A [`PreparedPhantom`] keeps the data shared by the exposures of one phantom, reports progress,
//! and computes a preview. An [`AnalogRun`] follows photons in parts that can be interrupted and resumed until the image is
//! precise enough, and counts the [`Dose`].
//!
//! `mcgpu` runs input files of MC-GPU v1.3.
//!
//! Units: mm, radians, keV, g/cm³, mass attenuation in cm²/g, images in eV/cm² per history. Frames: the phantom is in
//! `ct` (DICOM LPS); `device` has the source at the origin and z towards the detector. The device is moved, never the
//! voxels.
//! Approximations: electrons deposit their energy where they are set free, since at 150 keV they travel about 0.3 mm in water,
//! less than a voxel; photons below 5 keV are absorbed on the spot; only fluorescence K x-rays above 5 keV are followed. Cross
//! sections and spectra extend down to 1 keV.
//! [`Projection::new`] starts with a point source and a detector that absorbs everything; [`Source`] adds focal spot, heel
//! effect and collimation, [`Receptor`] grid, CsI or selenium, blur and electronic noise.
//! Results are reproducible: random numbers are addressed by seed and history and tallies are integers, so the number of
//! threads does not change a bit.
//!
//! ```
//! use nalgebra::{Isometry3, Point3, Vector3};
//! use ppa_ct::{Grid, Volume};
//! use ppa_xray::{Detector, FastSettings, HuCalibration, Projection, Spectrum, TubeSpec, VoxelPhantom, fast};
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! // A 60 mm cube of muscle with a rod of bone through it.
//! let grid = Grid::axis_aligned([30; 3], Vector3::repeat(2.0), Point3::new(-29.0, -29.0, -29.0))?;
//! let rod = |[i, j, _]: [usize; 3]| (13..17).contains(&i) && (13..17).contains(&j);
//! let hu = (0..grid.len()).map(|n| if rod(grid.voxel(n)) { 1200.0 } else { 50.0 }).collect();
//! let phantom = VoxelPhantom::from_volume(&Volume::new(grid, hu)?, &HuCalibration::default(), None)?;
//! let tube = TubeSpec::new(60.0, 12.0, vec!["Al:2.5".parse()?]);
//! let ct_from_device = Isometry3::translation(0.0, 0.0, -1000.0);
//! let exposure = Projection::new(ct_from_device, 1100.0, Detector::centred(50, 50, 2.0));
//! let settings = FastSettings::default().with_scatter_histories(20_000);
//! let radiograph = fast(&phantom, &Spectrum::tungsten(&tube)?, &exposure, &settings)?;
//! let reading = radiograph.total();
//! assert!(reading[25 * 50 + 25] < 0.25 * reading[25 * 50 + 10]); // behind the rod, beside it
//! # Ok(())
//! # }
//! ```

#![cfg_attr(
    not(feature = "files"),
    expect(dead_code, reason = "bytes of tallies serve files alone")
)]

mod beam;
mod detector;
mod dose;
mod engine;
mod image;
mod isa;
mod matter;
#[cfg(feature = "files")]
pub mod mcgpu;
mod octaves;
mod phantom;
mod run;
mod setters;
mod transport;
mod vector_math;

/// Scenes of the public interface's tests, some of which the unit tests use as well.
#[cfg(test)]
#[path = "../tests/it/scenes.rs"]
#[expect(dead_code, reason = "some scenes are for the other tests alone")]
mod scenes;

// The name by which `scenes` refers to this crate.
#[cfg(test)]
extern crate self as ppa_xray;

/// Vectors, points and poses used in the interface of this crate, in the required version.
pub use nalgebra;
/// Grids and volumes used in the interface of this crate, in the required version.
pub use ppa_ct;

pub use ppa_core::{Part, PartError, Side};

pub use beam::detector::Detector;
pub use beam::marker::SideMarker;
pub use beam::projection::Projection;
pub use beam::projection_error::ProjectionError;
pub use beam::receptor::{
    AntiScatterGrid, Blur, DetectorModel, LinesAlong, Receptor, ReceptorError,
};
pub use beam::source::{Collimation, Extrafocal, FocalSpot, HeelEffect, Source, SpotShape};
pub use beam::spectrum::Spectrum;
pub use beam::spectrum_error::SpectrumError;
pub use beam::tube::{Filter, TubeSpec};
pub use detector::readout::Layer;
pub use dose::map::DoseMapError;
pub use dose::report::{Dose, Estimate, Imparted, VoxelDose};
pub use dose::settings::{DoseError, DoseSettings, VoxelBox};
pub use dose::voxel_labels::VoxelLabels;
pub use engine::analog::{AnalogSettings, analog};
pub use engine::fast::fast;
pub use engine::fast_settings::FastSettings;
pub use engine::prepared_phantom::PreparedPhantom;
pub use engine::raytrace::primary;
pub use engine::tube_load::TubeLoad;
#[cfg(feature = "dicom")]
pub use image::dx::{
    DxExposure, DxIntent,
    examination::{Examination, Laterality, Region, View},
};
pub use image::exposure_index::deviation_index;
#[cfg(feature = "files")]
pub use image::output::{EXR_ATTRIBUTE, OutputError};
pub use image::presentation::{Presentation, PresentationError};
pub use image::radiograph::{CategorySums, Engine, Radiograph};
pub use matter::compton::ComptonModel;
pub use matter::cross_sections::CrossSections;
pub use matter::electron_shell::Shell;
pub use matter::energy_range::{MAX_ENERGY_KEV, MIN_ENERGY_KEV};
pub use matter::fluorescence::FluorescenceLine;
pub use matter::form_factors::FormFactors;
pub use matter::material::Material;
pub use matter::material_error::MaterialError;
pub use matter::photon_tables::PhotonTables;
pub use matter::sampler::{ComptonScattering, MaterialTables};
pub use matter::scatter_density::ScatterDensities;
pub use phantom::audit::{Audit, MaterialCount, SegmentAudit};
pub use phantom::calibration_error::CalibrationError;
pub use phantom::histogram::HuBin;
pub use phantom::hu::HuCalibration;
pub use phantom::interpolation::Interpolation;
pub use phantom::segment::{Composition, Constituent, Segment};
pub use phantom::voxels::{PhantomError, VoxelPhantom};
pub use run::analog_run::{AnalogRun, RunError};
pub use run::analog_tally::AnalogTally;
pub use run::progress::{Progress, Stop, Stopped};
#[cfg(feature = "files")]
pub use run::tally_error::TallyError;
#[cfg(feature = "files")]
pub use run::tally_file::TallyHistories;
pub use transport::tally::Category;
pub use transport::tracking::TransportError;
