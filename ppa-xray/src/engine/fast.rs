//! The fast engine: ray-traced primary, next-event estimation (forced detection) of scatter, quantum noise.
//!
//! docs/physics.md, "Fast engine". Forced detection: Kalos, Nucl. Sci. Eng. 16 (1963) 111; Williamson, Med. Phys. 14 (1987) 567.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::beam::projection::{Detector, Projection};
use crate::beam::spectrum::Spectrum;
use crate::detector::open_field::OpenField;
use crate::detector::tabulated_response::TabulatedResponse;
use crate::engine::adaptive_nodes::single_scatter_field;
use crate::engine::adaptive_primary::primary_moments;
use crate::engine::collision_map::CollisionMap;
use crate::engine::exposure::Exposure;
use crate::engine::first_collisions::{ESTIMATES, FirstFlights};
use crate::engine::importance::ImportanceModel;
use crate::engine::later_collisions::{Histories, VarianceReduction};
use crate::engine::lines::Lines;
use crate::engine::multiple_scatter::MultipleScatter;
use crate::engine::node_grid::NodeGrid;
use crate::engine::noise::{self, ExpectedLayer};
use crate::engine::paths::Paths;
use crate::engine::primary_signal::PrimarySignal;
use crate::engine::raytrace::check_samples;
use crate::engine::scatter_field::ScatterField;
use crate::engine::single_scatter::SingleScatter;
use crate::engine::spectral_quadrature::{Accuracy, compressed};
use crate::image::radiograph::{CategorySums, Engine, Radiograph};
use crate::matter::compton::ComptonModel;
use crate::matter::scatter_density::ScatterDensities;
use crate::phantom::voxels::VoxelPhantom;
use crate::transport::tally::Category;
use crate::transport::tracking::TransportError;

/// What the fast engine spends, and the exposure its image stands for.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FastSettings {
    /// Histories whose quantum noise the image carries; infinite gives the expected image.
    pub dose_histories: f64,
    /// Histories that are followed to find multiple scatter; half as many first collisions are listed, which is where they
    /// start and what single scatter is summed from. The scatter's error falls with the root of it.
    pub scatter_histories: u64,
    /// Largest distance of the points at which scatter is computed, mm.
    pub scatter_pixel_mm: f64,
    /// Most rays per pixel side of the primary, where the image has edges.
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
            scatter_histories: 320_000,
            scatter_pixel_mm: 20.0,
            samples_per_side: 8,
            compton_model: ComptonModel::default(),
            seed: 0,
        }
    }
}

/// Energies of the quadrature over the spectrum: errors are then 3e-5 of the primary behind any thickness, and 1e-3 of the scatter.
pub(crate) const PRIMARY_ENERGIES: Accuracy = Accuracy {
    most: 12,
    tolerance: 1e-5,
};
pub(crate) const SCATTER_ENERGIES: Accuracy = Accuracy {
    most: 8,
    tolerance: 3e-4,
};

/// How much farther apart than for single scatter the points for multiple scatter are.
const MULTIPLE_SPACING: f64 = 1.4;

/// First collisions on a list for each that a point of the detector in the dark samples.
const LISTED_PER_CHOICE: f64 = 32.0;

/// Simulates a radiograph of [`FastSettings::dose_histories`] photons at a fraction of the work.
///
/// Geometry, physics and units are those of [`crate::analog`], but for the K x-rays of contrast media, which are left out.
/// Primary: line integrals averaged over each pixel.
/// Scatter, which varies slowly: forced detection at points of the detector, close together where it bends, and cubic
/// interpolation to the pixels. Then every layer gets the noise of an energy-integrating detector. The standard errors
/// hold both that noise and the error of the scatter estimate, which neighbouring pixels share.
///
/// # Errors
/// [`TransportError`] when the geometry, the spectrum or a setting makes no sense.
pub fn fast(
    phantom: &VoxelPhantom,
    spectrum: &Spectrum,
    projection: &Projection,
    settings: &FastSettings,
) -> Result<Radiograph, TransportError> {
    settings.validate(&projection.detector)?;
    let exposure = Exposure::new(phantom, spectrum, projection, settings.compton_model)?;
    let transport = &exposure.transport;
    let detector = &projection.detector;
    let paths = Paths::new(transport);
    let lines = compressed(&exposure, PRIMARY_ENERGIES);
    let primary = primary_moments(
        &exposure,
        &paths,
        lines,
        settings.samples_per_side,
        settings.dose_histories,
    );
    let (open_field, open_field_ev_cm2) = OpenField::of(transport, &exposure.response);
    let signal = PrimarySignal {
        detector,
        moments: &primary,
        open_kev: open_field_ev_cm2 * detector.pixel_cm2() / 1e3,
    };
    let scatter = Scatter::new(
        &exposure,
        &paths,
        &signal,
        settings,
        VarianceReduction::default(),
    );
    let [compton, rayleigh, _] = &scatter.fields;
    let shared = compton.covariance_kev2(rayleigh, detector);
    let scattered = scatter.fields.map(|field| field.on_pixels(detector));
    let primary_kev = primary.iter().map(|pixel| pixel.mean_kev).sum::<f64>();
    let sums = CategorySums::from_kev(|category| match category {
        Category::Primary => (primary_kev, 0.0),
        _ => scattered[category as usize - 1].sum_kev,
    });
    let [compton, rayleigh, multiple] = scattered.map(|scatter| ExpectedLayer {
        moments: scatter.moments,
        variance_kev2: scatter.variance_kev2,
    });
    let primary = ExpectedLayer {
        variance_kev2: vec![0.0; primary.len()],
        moments: primary,
    };
    let expected = [primary, compton, rayleigh, multiple];
    let ev_cm2 = 1e3 / detector.pixel_cm2();
    let drawn = noise::drawn(&expected, ev_cm2, settings.dose_histories, settings.seed);
    let readout = &exposure.readout;
    let image = Radiograph {
        detector: projection.detector,
        engine: Engine::Fast,
        histories: settings.dose_histories,
        histories_per_mas: transport.emitter.photons_per_mas(),
        seed: settings.seed,
        source_detector_mm: projection.source_detector_mm,
        open_field_ev_cm2,
        open_field,
        layers: readout.drawn(drawn, detector.columns as usize),
        single_scatter_covariance: shared
            .into_iter()
            .map(|kev2| (kev2 * ev_cm2 * ev_cm2) as f32)
            .collect(),
        electronic: None,
        sums,
        largest_score_share: Some(scatter.largest_share),
    };
    Ok(image.with_electronic_noise(readout.electronic_noise_kev()))
}

/// Scatter of an exposure, before interpolation.
pub(crate) struct Scatter {
    /// Compton, Rayleigh, multiple.
    pub fields: [ScatterField; 3],
    pub largest_share: f64,
}

impl Scatter {
    pub fn new(
        exposure: &Exposure,
        paths: &Paths,
        primary: &PrimarySignal,
        settings: &FastSettings,
        variance_reduction: VarianceReduction,
    ) -> Self {
        let transport = &exposure.transport;
        let detector = primary.detector;
        let densities: Vec<ScatterDensities> = transport
            .phantom
            .materials()
            .par_iter()
            .map(|material| ScatterDensities::new(material, settings.compton_model))
            .collect();
        let lines = Lines::new(exposure, paths, &densities, SCATTER_ENERGIES);
        let mut map = CollisionMap::new(transport, paths, &lines);
        let importance_model = ImportanceModel::new(transport, paths, &densities, &map);
        map.set_density(&importance_model.importance(&map.cells, &primary.tolerances(transport)));
        let first = FirstFlights {
            transport,
            paths,
            lines: &lines,
            map: &map,
            importance_model: &importance_model,
        };
        let in_all = ESTIMATES as u64 * u64::from(variance_reduction.splitting);
        let listed = settings.scatter_histories.div_ceil(in_all);
        let lists = first.lists(settings.seed, listed);
        let response = TabulatedResponse::new(&exposure.response, lines.energies_kev());
        let single = SingleScatter {
            transport,
            response: &response,
            paths,
            importance_model: &importance_model,
            lines: &lines,
            lists: &lists,
        };
        let ([compton, rayleigh], single_share) = single_scatter_field(
            &single,
            detector,
            settings.scatter_pixel_mm,
            (settings.seed, listed as f64 / LISTED_PER_CHOICE),
            primary,
        );
        let nodes = NodeGrid::new(detector, MULTIPLE_SPACING * settings.scatter_pixel_mm);
        let multiple = MultipleScatter {
            histories: Histories {
                transport,
                paths,
                lines: &lines,
                lists: &lists,
                importance_model: &importance_model,
                variance_reduction,
            },
            response: &response,
            densities: &densities,
            nodes,
        };
        let estimate = multiple.fluence(settings.seed);
        let multiple = ScatterField {
            grid: nodes,
            estimates: estimate.fluence,
        };
        Self {
            fields: [compton, rayleigh, multiple],
            largest_share: single_share.max(estimate.largest_share),
        }
    }
}

impl FastSettings {
    /// Most histories that the noise of an image may stand for, if not infinitely many: a tube load of 3e7 mAs.
    const MOST_DOSE: f64 = 1e18;

    /// Most histories for the scatter: their first collisions take about 5 GB.
    const MOST_SCATTER: u64 = 100_000_000;

    /// Most points for scatter before any are set closer; a point and those around it take about 2 kB.
    const MOST_NODES: f64 = 1e5;

    fn validate(&self, detector: &Detector) -> Result<(), TransportError> {
        let [width, height] = detector.field().size_mm();
        let along = |size_mm: f64| (size_mm / self.scatter_pixel_mm).ceil() + 1.0;
        let distance_mm = self.scatter_pixel_mm;
        for (what, found, fine, expected) in [
            (
                "the number of histories for the noise",
                self.dose_histories,
                self.dose_histories >= 1.0
                    && (self.dose_histories <= Self::MOST_DOSE
                        || self.dose_histories == f64::INFINITY),
                "1 to 1e18, or infinite for none",
            ),
            (
                "the number of histories for the scatter",
                self.scatter_histories as f64,
                (1..=Self::MOST_SCATTER).contains(&self.scatter_histories),
                "1 to 1e8",
            ),
            (
                "the distance of the scatter points in mm",
                distance_mm,
                distance_mm > 0.0
                    && distance_mm.is_finite()
                    && along(width) * along(height) <= Self::MOST_NODES,
                "a positive length that sets at most 100000 points on the detector",
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
        check_samples(self.samples_per_side)
    }
}
