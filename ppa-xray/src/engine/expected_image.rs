//! The expected image of one source, and of focal and extrafocal radiation together.
//!
//! The signals of both are additive, and so are their images: each is computed separately, per own history, and weighted by its share of
//! the histories. docs/physics.md, "Extrafocal radiation".

use ppa_core::random::Philox;

use crate::detector::tabulated_response::TabulatedResponse;
use crate::engine::adaptive_nodes::single_scatter_field;
use crate::engine::adaptive_primary::primary_moments;
use crate::engine::collision_map::CollisionMap;
use crate::engine::exposure::Exposure;
use crate::engine::extrafocal_primary::extrafocal_primary;
use crate::engine::fast_progress::{Monitor, Observer};
use crate::engine::fast_settings::FastSettings;
use crate::engine::first_collisions::{ESTIMATES, FirstFlights};
use crate::engine::importance::ImportanceModel;
use crate::engine::later_collisions::{Histories, VarianceReduction};
use crate::engine::lines::Lines;
use crate::engine::multiple_scatter::MultipleScatter;
use crate::engine::node_grid::NodeGrid;
use crate::engine::paths::Paths;
use crate::engine::prepared_phantom::FastTables;
use crate::engine::primary_signal::PrimarySignal;
use crate::engine::scatter_field::{PixelScatter, ScatterField};
use crate::engine::single_scatter::SingleScatter;
use crate::engine::spectral_quadrature::{PRIMARY_ENERGIES, SCATTER_ENERGIES, compressed};
use crate::matter::scatter_density::ScatterDensities;
use crate::transport::stream::Stream;
use crate::transport::tally::{Moments, mix};
use crate::transport::tracking::TransportError;

/// Spacing of the points for multiple scatter relative to that for single scatter.
const MULTIPLE_SPACING: f64 = 1.4;

/// First collisions on a list per collision that a point of the detector in the dark samples.
const LISTED_PER_CHOICE: f64 = 32.0;

/// Share of the work for the focal spot if there is extrafocal radiation, for progress reports.
const FOCAL_DONE: f64 = 0.75;

/// Expected content of the pixels, per history.
pub(super) struct ExpectedImage {
    pub primary: Vec<Moments>,
    /// Compton, Rayleigh, multiple.
    pub scattered: [PixelScatter; 3],
    /// Covariance of the errors of Compton and Rayleigh scatter, keV².
    pub shared: Vec<f64>,
    /// Largest share of a single path in the scatter of a point of the detector.
    pub largest_share: f64,
}

impl ExpectedImage {
    /// Computes the image by focal and extrafocal photons; `open_kev` is the energy of a pixel in the open field.
    pub fn of_all_photons(
        exposure: &Exposure,
        tables: &FastTables,
        settings: &FastSettings,
        open_kev: f64,
        observe: Observer,
    ) -> Result<Self, TransportError> {
        let Some((extrafocal, share)) = exposure.of_extrafocal() else {
            return Self::of_spot(exposure, tables, settings, focal_primary, open_kev, observe);
        };
        let first = |done| observe(FOCAL_DONE * done);
        let focal = Self::of_spot(exposure, tables, settings, focal_primary, open_kev, &first)?;
        let settings = of_share(settings, share);
        let rest = |done| observe(FOCAL_DONE + (1.0 - FOCAL_DONE) * done);
        let beside = Self::of_spot(
            &extrafocal,
            tables,
            &settings,
            extrafocal_primary,
            open_kev,
            &rest,
        )?;
        Ok(focal.mixed_with(&beside, share))
    }

    /// Computes the image by the photons that leave the spot of an exposure's emitter, with its `primary`.
    fn of_spot(
        exposure: &Exposure,
        tables: &FastTables,
        settings: &FastSettings,
        primary: PrimaryImage,
        open_kev: f64,
        observe: Observer,
    ) -> Result<Self, TransportError> {
        let monitor = &Monitor::new(observe);
        let transport = &exposure.transport;
        let detector = &transport.projection.detector;
        let paths = Paths::with_tables(transport, tables.paths.clone());
        let primary = primary(exposure, &paths, settings, monitor);
        monitor.check()?;
        let signal = PrimarySignal {
            detector,
            moments: &primary,
            open_kev,
        };
        let scatter = Scatter::new(
            exposure,
            &paths,
            &signal,
            &tables.densities,
            settings,
            VarianceReduction::default(),
            monitor,
        );
        monitor.check()?;
        let [compton, rayleigh, _] = &scatter.fields;
        Ok(Self {
            shared: compton.covariance_kev2(rayleigh, detector),
            scattered: scatter.fields.map(|field| field.on_pixels(detector)),
            largest_share: scatter.largest_share,
            primary,
        })
    }

    /// Mixes this image with another that has a `share` of the histories, with independent errors.
    fn mixed_with(mut self, other: &Self, share: f64) -> Self {
        let weights = [1.0 - share, share];
        let mixed = |a: f64, b: f64| weights[0] * a + weights[1] * b;
        let mixed_variance =
            |a: f64, b: f64| weights[0] * weights[0] * a + weights[1] * weights[1] * b;
        let variances = |these: &mut [f64], those: &[f64]| {
            for (this, that) in these.iter_mut().zip(those) {
                *this = mixed_variance(*this, *that);
            }
        };
        mix(&mut self.primary, &other.primary, share);
        variances(&mut self.shared, &other.shared);
        for (this, that) in self.scattered.iter_mut().zip(&other.scattered) {
            mix(&mut this.moments, &that.moments, share);
            variances(&mut this.variance_kev2, &that.variance_kev2);
            let ((sum, error), (other_sum, other_error)) = (this.sum_kev, that.sum_kev);
            let variance = mixed_variance(error * error, other_error * other_error);
            this.sum_kev = (mixed(sum, other_sum), variance.sqrt());
        }
        self.largest_share = self.largest_share.max(other.largest_share);
        self
    }
}

/// First two moments per history of the primary energy in every pixel.
type PrimaryImage = fn(&Exposure, &Paths, &FastSettings, &Monitor) -> Vec<Moments>;

fn focal_primary(
    exposure: &Exposure,
    paths: &Paths,
    settings: &FastSettings,
    monitor: &Monitor,
) -> Vec<Moments> {
    primary_moments(
        exposure,
        paths,
        compressed(exposure, PRIMARY_ENERGIES),
        settings.samples_per_side,
        settings.dose_histories,
        monitor,
    )
}

/// Settings for photons that are a `share` of the histories: their errors are weighted by that share.
fn of_share(settings: &FastSettings, share: f64) -> FastSettings {
    let mut rng = Philox::new(settings.seed, Stream::Extrafocal as u32, 0);
    let words = [(); 2].map(|()| (rng.unit() * 4_294_967_296.0) as u64);
    FastSettings {
        dose_histories: settings.dose_histories * share * share,
        scatter_histories: ((settings.scatter_histories as f64 * share) as u64).max(1),
        seed: words[0] | words[1] << 32,
        ..*settings
    }
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
        densities: &[ScatterDensities],
        settings: &FastSettings,
        variance_reduction: VarianceReduction,
        monitor: &Monitor,
    ) -> Self {
        let transport = &exposure.transport;
        let detector = primary.detector;
        let lines = Lines::new(exposure, paths, densities, SCATTER_ENERGIES);
        let mut map = CollisionMap::new(transport, paths, &lines);
        let importance_model = ImportanceModel::new(transport, paths, densities, &map);
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
        let lists = first.lists(settings.seed, listed, monitor);
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
            monitor,
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
            densities,
            nodes,
        };
        let estimate = multiple.fluence(settings.seed, monitor);
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
