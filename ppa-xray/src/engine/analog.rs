//! Analog Monte Carlo: every event has its physical probability, no variance reduction.
//!
//! docs/physics.md, "Analog engine and dose". Free paths by delta (Woodcock) tracking with local majorants: Woodcock et al.,
//! ANL-7050 (1965) 557.

use std::ops::Range;

use nalgebra::Point2;
use ppa_core::random::Philox;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::beam::marker::SideMarker;
use crate::beam::projection::Projection;
use crate::beam::raster::Raster;
use crate::beam::spectrum::Spectrum;
use crate::detector::lubberts::Displacement;
use crate::detector::response::Response;
use crate::dose::score::{DoseScore, DoseTarget};
use crate::engine::analog_image::ImageSetup;
use crate::engine::exposure::Exposure;
use crate::image::radiograph::Radiograph;
use crate::matter::compton::ComptonModel;
use crate::phantom::voxels::VoxelPhantom;
use crate::setters::setters;
use crate::transport::score::{Arrival, Score};
use crate::transport::tally::{MOST_HISTORIES, Tally, TallyBuffer};
use crate::transport::tracking::TransportError;

/// How long the analog engine runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
#[non_exhaustive]
pub struct AnalogSettings {
    /// Photons emitted into the field.
    pub histories: u64,
    /// Seed of the image: history n of a seed is the same for any number of threads.
    pub seed: u64,
    /// Model of Compton scattering.
    pub compton_model: ComptonModel,
}

impl Default for AnalogSettings {
    /// Takes a minute or less: scatter to a few percent in a square centimetre.
    fn default() -> Self {
        Self {
            histories: 20_000_000,
            seed: 0,
            compton_model: ComptonModel::default(),
        }
    }
}

/// Histories per task: long enough to hide the cost of starting a task.
const BATCH: u64 = 16_384;

/// Simulates a radiograph photon by photon.
///
/// Photons leave the focal spot into the field, with energies from `spectrum`, and are followed through the voxels
/// (vacuum outside) until they are absorbed, fall below 5 keV, or cross the detector plane. There, grid and converter
/// determine the deposited energy. Nothing is scattered back from behind the plane.
///
/// # Errors
/// [`TransportError`] if the geometry, the spectrum or the number of histories is invalid.
pub fn analog(
    phantom: &VoxelPhantom,
    spectrum: &Spectrum,
    projection: &Projection,
    settings: &AnalogSettings,
) -> Result<Radiograph, TransportError> {
    settings.validate()?;
    let exposure = Exposure::new(phantom, spectrum, projection, settings.compton_model)?;
    let tally = run(&exposure, projection.detector.raster(), settings);
    Ok(ImageSetup::new(&exposure).radiograph(&tally, settings.histories, settings.seed))
}

setters!(AnalogSettings {
    with_histories: histories = u64,
    with_seed: seed = u64,
    with_compton_model: compton_model = ComptonModel,
});

impl AnalogSettings {
    /// Largest number of histories of a run. No sum overflows, even if all of them hit one pixel.
    pub const MOST_HISTORIES: u64 = MOST_HISTORIES;

    pub(crate) fn validate(&self) -> Result<(), TransportError> {
        if !(1..=MOST_HISTORIES).contains(&self.histories) {
            return Err(TransportError::Setting {
                what: "the number of histories",
                found: self.histories as f64,
                expected: "1 to 5e11",
            });
        }
        Ok(())
    }
}

/// Follows all histories and counts the arrivals on `raster`.
pub(crate) fn run(exposure: &Exposure, raster: Raster, settings: &AnalogSettings) -> Tally {
    let tally = Tally::new(raster);
    count(exposure, settings.seed, 0..settings.histories, &tally);
    tally
}

/// Follows `histories` and counts the arrivals.
pub(crate) fn count(exposure: &Exposure, seed: u64, histories: Range<u64>, tally: &Tally) {
    in_batches(exposure, histories, |batch| {
        let mut score = DetectorScore::new(exposure, tally);
        exposure.transport.follow(seed, batch, &mut score);
    });
}

/// Follows `histories` and counts the arrivals and the deposited energy.
pub(crate) fn count_with_dose(
    exposure: &Exposure,
    seed: u64,
    histories: Range<u64>,
    tally: &Tally,
    target: &DoseTarget,
) {
    in_batches(exposure, histories, |batch| {
        let mut score = DoseScore::new(DetectorScore::new(exposure, tally), target);
        exposure.transport.follow(seed, batch, &mut score);
        score.hand_in();
    });
}

/// Distributes `histories` over the threads.
fn in_batches(exposure: &Exposure, histories: Range<u64>, follow: impl Fn(Range<u64>) + Sync) {
    exposure.transport.tables.majorants();
    let batches = (histories.end - histories.start).div_ceil(BATCH);
    (0..batches).into_par_iter().for_each(|batch| {
        let first = histories.start + batch * BATCH;
        follow(first..(first + BATCH).min(histories.end));
    });
}

/// Counts only the energy that photons deposit in the detector.
struct DetectorScore<'a> {
    marker: Option<SideMarker>,
    response: &'a Response,
    /// Displacement of photons before they are counted, and the raster that they stay in.
    displacement: Option<(&'a Displacement, Raster)>,
    /// Side of the square over which a photon's energy is spread, in pixels.
    spot_pixels: f64,
    buffer: TallyBuffer<'a>,
}

impl<'a> DetectorScore<'a> {
    fn new(exposure: &'a Exposure, tally: &'a Tally) -> Self {
        Self {
            marker: exposure.transport.projection.marker,
            response: &exposure.response,
            displacement: exposure
                .readout
                .displacement()
                .map(|displacement| (displacement, tally.raster)),
            spot_pixels: exposure.readout.spot_pixels(),
            buffer: TallyBuffer::new(tally),
        }
    }
}

impl Score for DetectorScore<'_> {
    #[inline]
    fn arrive(&mut self, _slot: usize, arrival: &Arrival, rng: &mut Philox) {
        let Arrival { x_mm, y_mm, .. } = *arrival;
        let at = Point2::new(x_mm, y_mm);
        if self.marker.is_some_and(|marker| marker.covers(at)) {
            return;
        }
        let energy_kev = self.response.detect(arrival, rng);
        let [x_mm, y_mm] = match &self.displacement {
            None => [x_mm, y_mm],
            Some((displacement, raster)) => raster.moved([x_mm, y_mm], displacement.draw(rng)),
        };
        if self.spot_pixels == 0.0 {
            self.buffer.score(x_mm, y_mm, arrival.category, energy_kev);
        } else {
            let spot = self.spot_pixels;
            self.buffer
                .spread(x_mm, y_mm, spot, arrival.category, energy_kev);
        }
    }
}
