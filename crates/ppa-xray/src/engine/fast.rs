//! The fast engine: ray-traced primary, Monte Carlo scatter on a coarse raster, quantum noise on top.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::beam::projection::{Detector, Projection};
use crate::beam::spectrum::Spectrum;
use crate::detector::open_field::OpenField;
use crate::engine::analog::{AnalogSettings, run};
use crate::engine::noise;
use crate::engine::raytrace::primary_moments;
use crate::engine::upsample::Upsampling;
use crate::image::radiograph::{CategorySums, Engine, Layer, Radiograph};
use crate::matter::compton::ComptonModel;
use crate::phantom::voxels::VoxelPhantom;
use crate::philox::Philox;
use crate::transport::stream::Stream;
use crate::transport::tally::{Category, Moments, Raster, Tally};
use crate::transport::tracking::{Transport, TransportError};

/// What the fast engine spends, and the exposure its image stands for.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FastSettings {
    /// Histories whose quantum noise the image carries; infinite gives the expected image.
    pub dose_histories: f64,
    /// Histories that are followed to find the scatter.
    pub scatter_histories: u64,
    /// Largest side of the cells in which the scatter is counted, mm.
    pub scatter_pixel_mm: f64,
    /// Rays per pixel side of the primary.
    pub samples_per_side: u32,
    /// How photons scatter off electrons.
    pub compton_model: ComptonModel,
    /// Seed of the image.
    pub seed: u64,
}

impl Default for FastSettings {
    /// The 2e10 histories of Laufer et al. 2026, section 3.3.
    fn default() -> Self {
        Self {
            dose_histories: 2e10,
            scatter_histories: 4_000_000,
            scatter_pixel_mm: 20.0,
            samples_per_side: 2,
            compton_model: ComptonModel::default(),
            seed: 0,
        }
    }
}

/// Simulates a radiograph of [`FastSettings::dose_histories`] photons at a fraction of the work.
///
/// Geometry, physics and units are those of [`crate::engine::analog`]. Primary: line integrals averaged over each pixel.
/// Scatter, which varies slowly: [`FastSettings::scatter_histories`] analog histories on coarse cells, carried to the
/// pixels by quadratic B-splines that keep its sum. Then every layer gets the noise of an energy-integrating
/// detector. The standard errors hold both that noise and the error of the scatter estimate, which
/// neighbouring pixels share.
///
/// # Errors
/// [`TransportError`] when the geometry, the spectrum or a setting makes no sense.
pub fn fast(
    phantom: &VoxelPhantom,
    spectrum: &Spectrum,
    projection: &Projection,
    settings: &FastSettings,
) -> Result<Radiograph, TransportError> {
    settings.validate()?;
    let transport = Transport::new(phantom, spectrum, projection, settings.compton_model)?;
    let histories = settings.scatter_histories;
    let raster = scatter_raster(&projection.detector, settings.scatter_pixel_mm);
    let analog = AnalogSettings {
        histories,
        seed: settings.seed,
        compton_model: settings.compton_model,
    };
    let tally = run(&transport, raster, &analog);
    let primary = primary_moments(&transport, settings.samples_per_side)?;
    let primary_kev = primary.iter().map(|pixel| pixel.mean_kev).sum::<f64>();
    let sums = CategorySums::from_kev(|category| match category {
        Category::Primary => (primary_kev, 0.0),
        _ => {
            let total = tally.total(category, histories);
            (total.mean_kev, total.standard_error_kev(histories as f64))
        }
    });
    let upsampling = Upsampling::new(&raster, &projection.detector);
    let expected = Category::ALL.map(|category| match category {
        Category::Primary => Expected {
            variance_kev2: vec![0.0; primary.len()],
            moments: primary.clone(),
        },
        _ => Expected::scatter(&tally, category, histories, &upsampling),
    });
    let (open_field, open_field_ev_cm2) = OpenField::of(&transport);
    Ok(transport.readout.read(Radiograph {
        detector: projection.detector,
        engine: Engine::Fast,
        histories: settings.dose_histories,
        histories_per_mas: transport.emitter.photons_per_mas(),
        seed: settings.seed,
        source_detector_mm: projection.source_detector_mm,
        open_field_ev_cm2,
        open_field,
        layers: with_noise(&expected, settings, &projection.detector),
        electronic: None,
        sums,
    }))
}

impl FastSettings {
    fn validate(&self) -> Result<(), TransportError> {
        let positive = "a positive number";
        for (what, found, fine, expected) in [
            (
                "the number of histories for the noise",
                self.dose_histories,
                self.dose_histories > 0.0,
                positive,
            ),
            (
                "the number of histories for the scatter",
                self.scatter_histories as f64,
                self.scatter_histories > 0,
                positive,
            ),
            (
                "the side of the scatter cells in mm",
                self.scatter_pixel_mm,
                self.scatter_pixel_mm > 0.0 && self.scatter_pixel_mm.is_finite(),
                "a positive length",
            ),
        ] {
            if !fine {
                return Err(TransportError::Setting {
                    what,
                    found,
                    expected,
                });
            }
        }
        Ok(())
    }
}

/// What a layer holds in the mean.
struct Expected {
    moments: Vec<Moments>,
    /// Squared standard error of the mean energy, keV² per history.
    variance_kev2: Vec<f64>,
}

impl Expected {
    fn scatter(tally: &Tally, category: Category, histories: u64, upsampling: &Upsampling) -> Self {
        let cells = tally.moments(category, histories);
        let plane = |of: fn(&Moments) -> f64| -> Vec<f64> { cells.iter().map(of).collect() };
        let mean = upsampling.densities(&plane(|cell| cell.mean_kev));
        let square = upsampling.densities(&plane(|cell| cell.square_kev2));
        let variances: Vec<f64> = cells
            .iter()
            .map(|cell| cell.standard_error_kev(histories as f64).powi(2))
            .collect();
        Self {
            moments: mean
                .into_iter()
                .zip(square)
                .map(|(mean_kev, square_kev2)| Moments {
                    mean_kev,
                    square_kev2,
                })
                .collect(),
            variance_kev2: upsampling.variances(&variances),
        }
    }
}

fn scatter_raster(detector: &Detector, cell_mm: f64) -> Raster {
    let fine = detector.raster();
    let cells =
        |extent_mm: f64, most: usize| ((extent_mm / cell_mm).ceil() as usize).clamp(1, most);
    Raster {
        columns: cells(fine.extent_mm[0], fine.columns),
        rows: cells(fine.extent_mm[1], fine.rows),
        ..fine
    }
}

fn with_noise(
    expected: &[Expected; 4],
    settings: &FastSettings,
    detector: &Detector,
) -> [Layer; 4] {
    let ev_cm2 = 1e3 / detector.pixel_cm2();
    let noisy = settings.dose_histories.is_finite();
    let pixels: Vec<[(f32, f32); 4]> = (0..detector.pixels())
        .into_par_iter()
        .map(|pixel| {
            let mut rng = Philox::new(settings.seed, Stream::QuantumNoise as u32, pixel as u64);
            expected.each_ref().map(|layer| {
                let moments = &layer.moments[pixel];
                let (value, quantum) = if noisy {
                    let value = noise::draw(moments, settings.dose_histories, &mut rng);
                    (value, moments.square_kev2 / settings.dose_histories)
                } else {
                    (moments.mean_kev, 0.0)
                };
                let sigma = (quantum + layer.variance_kev2[pixel]).sqrt();
                ((value * ev_cm2) as f32, (sigma * ev_cm2) as f32)
            })
        })
        .collect();
    [0, 1, 2, 3].map(|layer| {
        let (value, sigma) = pixels.iter().map(|pixel| pixel[layer]).unzip();
        Layer { value, sigma }
    })
}
