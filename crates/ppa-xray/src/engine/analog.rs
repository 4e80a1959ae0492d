//! The analog engine: every history as nature plays it.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::beam::projection::Projection;
use crate::beam::spectrum::Spectrum;
use crate::image::radiograph::{CategorySums, Engine, Layer, Radiograph, open_field_ev_cm2};
use crate::phantom::voxels::VoxelPhantom;
use crate::philox::Philox;
use crate::transport::score::{Arrival, Score};
use crate::transport::tally::{Category, Raster, Tally};
use crate::transport::tracking::{Transport, TransportError};

/// How long the analog engine runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AnalogSettings {
    /// Photons emitted into the field.
    pub histories: u64,
    /// Seed of the image: history n of a seed is the same whatever runs beside it.
    pub seed: u64,
}

/// Histories that one task follows: long enough to hide the hand-over.
const BATCH: u64 = 4_096;

/// Simulates a radiograph photon by photon.
///
/// Photons leave the focal spot evenly in solid angle inside the detector rectangle, with energies from
/// `spectrum`, and are followed through the voxels (vacuum outside) until they are absorbed, fall below
/// 5 keV, or cross the detector plane. The ideal detector takes the whole energy of photons that cross its
/// rectangle; nothing comes back from behind the plane.
///
/// # Errors
/// [`TransportError`] when the geometry, the spectrum or the number of histories makes no sense.
pub fn analog(
    phantom: &VoxelPhantom,
    spectrum: &Spectrum,
    projection: &Projection,
    settings: &AnalogSettings,
) -> Result<Radiograph, TransportError> {
    let AnalogSettings { histories, seed } = *settings;
    if histories == 0 {
        return Err(TransportError::Setting {
            what: "the number of histories",
            found: 0.0,
            expected: "1 or more",
        });
    }
    let transport = Transport::new(phantom, spectrum, projection)?;
    let tally = run(&transport, projection.detector.raster(), settings);
    let ev_cm2 = 1e3 / tally.raster.cell_cm2();
    let layers = Category::ALL.map(|category| {
        let (value, sigma) = tally
            .moments(category, histories)
            .iter()
            .map(|pixel| {
                let sigma = pixel.standard_error_kev(histories as f64);
                ((pixel.mean_kev * ev_cm2) as f32, (sigma * ev_cm2) as f32)
            })
            .unzip();
        Layer { value, sigma }
    });
    let sums = CategorySums::from_kev(|category| {
        let total = tally.total(category, histories);
        (total.mean_kev, total.standard_error_kev(histories as f64))
    });
    Ok(Radiograph {
        detector: projection.detector,
        engine: Engine::Analog,
        histories: histories as f64,
        seed,
        source_detector_mm: projection.source_detector_mm,
        open_field_ev_cm2: open_field_ev_cm2(&transport),
        layers,
        sums,
    })
}

/// Follows all histories and counts what arrives on `raster`.
pub(crate) fn run(transport: &Transport, raster: Raster, settings: &AnalogSettings) -> Tally {
    let tally = Tally::new(raster);
    let batches = settings.histories.div_ceil(BATCH);
    (0..batches).into_par_iter().for_each(|batch| {
        let first = batch * BATCH;
        let last = (first + BATCH).min(settings.histories);
        transport.follow(settings.seed, first..last, &mut DetectorScore(&tally));
    });
    tally
}

/// Counts what reaches the detector, nothing else.
struct DetectorScore<'a>(&'a Tally);

impl Score for DetectorScore<'_> {
    #[inline]
    fn arrive(&mut self, _slot: usize, arrival: &Arrival, _rng: &mut Philox) {
        let Arrival { x_mm, y_mm, .. } = *arrival;
        self.0
            .score(x_mm, y_mm, arrival.category, arrival.energy_kev);
    }
}
