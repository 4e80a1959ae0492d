//! Result of both engines: energy per pixel by category, with standard errors.

use serde::{Deserialize, Serialize};

use crate::beam::detector::Detector;
use crate::detector::open_field::OpenField;
use crate::detector::readout::Layer;
use crate::transport::tally::Category;

/// How a radiograph was computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Engine {
    /// Analog Monte Carlo, no variance reduction.
    Analog,
    /// Ray-traced primary, Monte Carlo scatter, added quantum noise.
    Fast,
}

/// Energy on the whole detector by category, eV per history, each with its standard error.
///
/// The fast engine computes all scatter from the same collisions: the error of a sum of categories is larger than for
/// independent categories, up to the sum of their errors.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[non_exhaustive]
pub struct CategorySums {
    /// Photons without interaction.
    pub primary_ev_per_history: f64,
    /// Its standard error.
    pub primary_ev_per_history_se: f64,
    /// Photons with one Compton scattering.
    pub compton_ev_per_history: f64,
    /// Its standard error.
    pub compton_ev_per_history_se: f64,
    /// Photons with one Rayleigh scattering.
    pub rayleigh_ev_per_history: f64,
    /// Its standard error.
    pub rayleigh_ev_per_history_se: f64,
    /// Photons scattered twice or more.
    pub multiple_ev_per_history: f64,
    /// Its standard error.
    pub multiple_ev_per_history_se: f64,
}

impl CategorySums {
    /// Energy and its standard error of one category, eV per history.
    pub fn of(&self, category: Category) -> (f64, f64) {
        match category {
            Category::Primary => (self.primary_ev_per_history, self.primary_ev_per_history_se),
            Category::Compton => (self.compton_ev_per_history, self.compton_ev_per_history_se),
            Category::Rayleigh => (
                self.rayleigh_ev_per_history,
                self.rayleigh_ev_per_history_se,
            ),
            Category::Multiple => (
                self.multiple_ev_per_history,
                self.multiple_ev_per_history_se,
            ),
        }
    }

    /// Energy of all categories together, eV per history.
    pub fn total_ev_per_history(&self) -> f64 {
        Category::ALL
            .iter()
            .map(|&category| self.of(category).0)
            .sum()
    }

    pub(crate) fn from_kev(of: impl Fn(Category) -> (f64, f64)) -> Self {
        let ev = |category| {
            let (mean_kev, se_kev) = of(category);
            (1e3 * mean_kev, 1e3 * se_kev)
        };
        let (primary, compton) = (ev(Category::Primary), ev(Category::Compton));
        let (rayleigh, multiple) = (ev(Category::Rayleigh), ev(Category::Multiple));
        Self {
            primary_ev_per_history: primary.0,
            primary_ev_per_history_se: primary.1,
            compton_ev_per_history: compton.0,
            compton_ev_per_history_se: compton.1,
            rayleigh_ev_per_history: rayleigh.0,
            rayleigh_ev_per_history_se: rayleigh.1,
            multiple_ev_per_history: multiple.0,
            multiple_ev_per_history_se: multiple.1,
        }
    }
}

/// Energy that photons deposit in the detector, split by their interactions on the way.
///
/// Pixel (column, row) has the index `row * columns + column`; columns run along device x, rows along
/// device y. Values are eV/cm² per history, the unit of MC-GPU. Their sum over the pixels times
/// the pixel area is in eV per history.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Radiograph {
    /// Number, size and position of the pixels.
    pub detector: Detector,
    /// Engine that computed the radiograph.
    pub engine: Engine,
    /// Histories that the noise of the image represents; infinite for the expected image.
    pub histories: f64,
    /// Photons that the tube emits into the field per mAs, if the spectrum has a fluence. Multiply values per
    /// history by it to get values per mAs.
    pub histories_per_mas: Option<f64>,
    /// Seed of the random numbers.
    pub seed: u64,
    /// Source-detector distance, mm.
    pub source_detector_mm: f64,
    /// Reading of the centre of the detector with nothing in the beam, eV/cm² per history.
    pub open_field_ev_cm2: f64,
    /// The same reading over the detector.
    pub(crate) open_field: OpenField,
    /// The layers, in the order of [`Category::ALL`].
    pub layers: [Layer; 4],
    /// Covariance of the errors of Compton and Rayleigh scatter in every pixel, which the fast engine finds from the same
    /// collisions; empty for the analog engine.
    pub(crate) single_scatter_covariance: Vec<f32>,
    /// Electronic noise of the detector, if it has any: mean 0, the same standard deviation in every pixel.
    pub electronic: Option<Layer>,
    /// Energy on the whole detector. For the fast engine, it is taken before quantum noise is added, so
    /// the primary has no standard error.
    pub sums: CategorySums,
    /// Fast engine: the largest share of a single photon path in the scatter at a point of the detector.
    /// A small share is good: many paths contribute. `None` for the analog engine, where all photons have the same weight.
    pub largest_score_share: Option<f64>,
}

impl Radiograph {
    /// Pixels along device x.
    pub fn columns(&self) -> usize {
        self.detector.columns as usize
    }

    /// Pixels along device y.
    pub fn rows(&self) -> usize {
        self.detector.rows as usize
    }

    /// The layer of one category.
    pub fn layer(&self, category: Category) -> &Layer {
        &self.layers[category as usize]
    }

    /// All layers, including electronic noise.
    pub(super) fn planes(&self) -> impl Iterator<Item = &Layer> {
        self.layers.iter().chain(&self.electronic)
    }

    /// Reading of every pixel, the sum of all layers, eV/cm² per history; NaN where a layer lacks the pixel.
    pub fn total(&self) -> Vec<f32> {
        self.per_pixel(|pixel| {
            self.planes()
                .map(|layer| {
                    layer
                        .value
                        .get(pixel)
                        .map_or(f64::NAN, |&value| value.into())
                })
                .sum()
        })
    }

    /// Standard error of [`Radiograph::total`].
    ///
    /// The fast engine computes all scatter from the same collisions. The covariance of Compton and Rayleigh scatter is
    /// included; multiple scatter is treated as independent of both, which is correct to 5 % of the error. NaN where a layer
    /// lacks the pixel.
    pub fn sigma(&self) -> Vec<f32> {
        self.per_pixel(|pixel| {
            let variances = self
                .planes()
                .map(|layer| {
                    layer
                        .sigma
                        .get(pixel)
                        .map_or(f64::NAN, |&sigma| sigma.into())
                })
                .map(|sigma: f64| sigma * sigma);
            let shared = self.single_scatter_covariance.get(pixel);
            let shared = shared.map_or(0.0, |&shared| 2.0 * f64::from(shared));
            let variance = variances.sum::<f64>() + shared;
            // Not `max`, which would turn a missing value into 0.
            if variance < 0.0 { 0.0 } else { variance.sqrt() }
        })
    }

    /// Tube load that corresponds to the quantum noise of the image, mAs.
    pub fn mas(&self) -> Option<f64> {
        Some(self.histories / self.histories_per_mas?)
    }

    /// Reading of a pixel with nothing in the beam and the collimator fully open, eV/cm² per history.
    pub fn open_field_at(&self, pixel: usize) -> f64 {
        let at = self.detector.pixel_centre_mm(pixel);
        self.open_field_ev_cm2 * self.open_field.at(at)
    }

    /// Whether the entire pixel is in the field of the collimator.
    pub fn in_field(&self, pixel: usize) -> bool {
        let at = self.detector.pixel_centre_mm(pixel);
        self.open_field.exposes(at, self.detector.pixel_mm)
    }

    fn per_pixel(&self, value: impl Fn(usize) -> f64) -> Vec<f32> {
        (0..self.detector.pixels())
            .map(|pixel| value(pixel) as f32)
            .collect()
    }
}
