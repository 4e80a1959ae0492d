//! Data shared by all histories of a projection, checked before the first one.

use std::sync::Arc;

use nalgebra::Point3;
use ppa_core::random::Philox;

use crate::beam::emitter::{Emission, Emitter};
use crate::beam::extrafocal::ExtrafocalEmitter;
use crate::beam::projection::Projection;
use crate::beam::projection_error::ProjectionError;
use crate::beam::spectrum::Spectrum;
use crate::matter::compton::ComptonModel;
use crate::matter::energy_range::{CUTOFF_KEV, MAX_ENERGY_KEV};
use crate::phantom::lattice::Lattice;
use crate::phantom::voxels::VoxelPhantom;
use crate::transport::phantom_tables::PhantomTables;

/// Why a simulation cannot run.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TransportError {
    /// Source, detector and phantom are not consistent.
    #[error(transparent)]
    Projection(#[from] ProjectionError),
    /// The spectrum extends beyond the energy range of the transport.
    #[error(
        "{percent:.3} % of the spectrum lies outside {CUTOFF_KEV} to {MAX_ENERGY_KEV} keV, the range in which photons are tracked"
    )]
    Spectrum {
        /// Share of the photons outside the range.
        percent: f64,
    },
    /// A material has no data at energies of the spectrum.
    #[error(
        "{percent:.3} % of the spectrum lies outside {low_kev} to {high_kev} keV, the range of the data of material {material:?}"
    )]
    MaterialRange {
        /// Name of the material.
        material: String,
        /// Lowest energy of its data, keV.
        low_kev: f64,
        /// Highest energy of its data, keV.
        high_kev: f64,
        /// Share of the photons outside the range.
        percent: f64,
    },
    /// The phantom was prepared for another Compton model.
    #[error(
        "the phantom was prepared for the Compton model {prepared:?}, but the settings specify {found:?}"
    )]
    ComptonModel {
        /// Model in the settings.
        found: ComptonModel,
        /// Model that the phantom was prepared for.
        prepared: ComptonModel,
    },
    /// A tube load cannot be converted to histories.
    #[error("cannot derive the number of histories from the tube load: {why}")]
    TubeLoad {
        /// What is missing.
        why: &'static str,
    },
    /// The progress observer cancelled the work.
    #[error("the simulation was cancelled")]
    Cancelled,
    /// A number in the settings is out of range.
    #[error("{what} is {found:?}, expected {expected}")]
    Setting {
        /// Name of the setting.
        what: &'static str,
        /// Value found.
        found: f64,
        /// Allowed range.
        expected: &'static str,
    },
}

/// Tissue denser than this (lung, foam) must not be behind the detector or at the source.
pub(crate) const SOLID_G_CM3: f32 = 0.3;

/// Data shared by the histories of one projection.
pub(crate) struct Transport<'a> {
    pub tables: Arc<PhantomTables<'a>>,
    pub spectrum: &'a Spectrum,
    pub projection: &'a Projection,
    /// Photons of the focal spot.
    pub emitter: Emitter,
    /// Photons from the area around the focal spot.
    pub extrafocal: Option<ExtrafocalEmitter>,
    pub lattice: Lattice,
}

impl<'a> Transport<'a> {
    pub fn new(
        tables: Arc<PhantomTables<'a>>,
        spectrum: &'a Spectrum,
        projection: &'a Projection,
    ) -> Result<Self, TransportError> {
        let phantom = &*tables.phantom;
        let emitter = Emitter::new(projection, spectrum)?;
        let extrafocal = ExtrafocalEmitter::beside(&emitter, projection, spectrum)?;
        check_placement(phantom, projection)?;
        let outside = |[low_kev, high_kev]: [f64; 2]| -> f64 {
            spectrum
                .bins()
                .filter(|(energy_kev, _)| !(low_kev..=high_kev).contains(energy_kev))
                .map(|(_, probability)| probability)
                .sum()
        };
        let percent = 100.0 * outside([CUTOFF_KEV, MAX_ENERGY_KEV]);
        if percent > 1e-2 {
            return Err(TransportError::Spectrum { percent });
        }
        for material in phantom.materials() {
            let [low_kev, high_kev] = material.energy_range_kev();
            let percent = 100.0 * outside([low_kev, high_kev]);
            if percent > 1e-2 {
                return Err(TransportError::MaterialRange {
                    material: material.name().to_owned(),
                    low_kev,
                    high_kev,
                    percent,
                });
            }
        }
        Ok(Self {
            spectrum,
            projection,
            emitter,
            extrafocal,
            lattice: Lattice::new(phantom.grid(), &projection.ct_from_device),
            tables,
        })
    }

    /// Samples a photon of the tube, focal or extrafocal.
    #[inline]
    pub fn emit(&self, rng: &mut Philox) -> Emission {
        match &self.extrafocal {
            Some(beside) if rng.unit() < beside.share => beside.emitter.emit(rng),
            _ => self.emitter.emit(rng),
        }
    }

    /// The spectrum of a plain beam, whose photons all leave the origin uniformly in solid angle.
    pub fn plain_beam(&self) -> Option<&Spectrum> {
        let spectrum = self.emitter.plain_beam()?;
        self.extrafocal.is_none().then_some(spectrum)
    }

    /// Histories per mAs: photons that the tube emits into the field, if the spectrum came from the tube model.
    pub fn histories_per_mas(&self) -> Option<f64> {
        ExtrafocalEmitter::histories_per_mas(&self.emitter, self.extrafocal.as_ref())
    }

    /// Ratio of the fluence per history with the collimator fully open to that of the focal photons per focal history.
    pub fn open_over_focal(&self) -> f64 {
        let beside = self.extrafocal.as_ref();
        beside.map_or(1.0, ExtrafocalEmitter::open_over_focal)
    }

    /// Returns the same photons with another detector in the same plane.
    pub fn with_projection<'b>(&'b self, projection: &'b Projection) -> Transport<'b> {
        Transport {
            tables: self.tables.clone(),
            spectrum: self.spectrum,
            projection,
            emitter: self.emitter.clone(),
            extrafocal: self.extrafocal.clone(),
            lattice: self.lattice.clone(),
        }
    }

    /// The same exposure with extrafocal photons only, and their share of the histories.
    pub fn of_extrafocal(&self) -> Option<(Self, f64)> {
        let beside = self.extrafocal.as_ref()?;
        let alone = Self {
            tables: self.tables.clone(),
            emitter: beside.emitter.clone(),
            extrafocal: None,
            lattice: self.lattice.clone(),
            ..*self
        };
        Some((alone, beside.share))
    }
}

fn check_placement(phantom: &VoxelPhantom, projection: &Projection) -> Result<(), ProjectionError> {
    let device_from_ct = projection.ct_from_device.inverse();
    let corners = phantom.corners_ct().map(|corner| device_from_ct * corner);
    if !projection.field_may_meet(&corners) {
        return Err(ProjectionError::FieldMissesPhantom);
    }
    let grid = phantom.grid();
    let plane_mm = projection.source_detector_mm;
    if corners.iter().any(|corner| corner.z > plane_mm) {
        let hidden = phantom
            .density_g_cm3()
            .iter()
            .enumerate()
            .filter(|(_, density)| **density > SOLID_G_CM3)
            .map(|(index, &density)| (grid.voxel(index), density))
            .map(|(voxel, density)| {
                let centre = device_from_ct * grid.centre(voxel.map(|v| v as f64));
                (voxel, density, centre.z - plane_mm)
            })
            .find(|(_, _, depth_mm)| *depth_mm > 0.0);
        if let Some((voxel, density_g_cm3, depth_mm)) = hidden {
            return Err(ProjectionError::DetectorInsidePhantom {
                voxel,
                density_g_cm3,
                depth_mm,
            });
        }
    }
    let source = grid.voxel_from_ct() * Point3::from(projection.ct_from_device.translation.vector);
    let nearest = source.coords.map(f64::round);
    let inside =
        (0..3).all(|axis| nearest[axis] >= 0.0 && nearest[axis] < grid.size()[axis] as f64);
    if inside {
        let voxel = [0, 1, 2].map(|axis| nearest[axis] as usize);
        let density_g_cm3 = phantom.density_g_cm3()[grid.index(voxel)];
        if density_g_cm3 > SOLID_G_CM3 {
            return Err(ProjectionError::SourceInsidePhantom {
                voxel,
                density_g_cm3,
            });
        }
    }
    Ok(())
}
