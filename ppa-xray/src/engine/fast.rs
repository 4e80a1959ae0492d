//! The fast engine: ray-traced primary, next-event estimation (forced detection) of scatter, quantum noise.
//!
//! docs/physics.md, "Fast engine". Forced detection: Kalos, Nucl. Sci. Eng. 16 (1963) 111; Williamson, Med. Phys. 14 (1987) 567.

use std::ops::ControlFlow;

use crate::beam::projection::Projection;
use crate::beam::spectrum::Spectrum;
use crate::detector::open_field::OpenField;
use crate::detector::tabulated_response::TabulatedResponse;
use crate::engine::adaptive_nodes::single_scatter_field;
use crate::engine::adaptive_primary::primary_moments;
use crate::engine::collision_map::CollisionMap;
use crate::engine::exposure::Exposure;
use crate::engine::fast_progress::Monitor;
use crate::engine::fast_settings::FastSettings;
use crate::engine::first_collisions::{ESTIMATES, FirstFlights};
use crate::engine::grid_shadow::{self, ShadowedPrimary};
use crate::engine::importance::ImportanceModel;
use crate::engine::later_collisions::{Histories, VarianceReduction};
use crate::engine::lines::Lines;
use crate::engine::marker_shadow::shade;
use crate::engine::multiple_scatter::MultipleScatter;
use crate::engine::node_grid::NodeGrid;
use crate::engine::noise::{self, ExpectedLayer};
use crate::engine::paths::Paths;
use crate::engine::prepared_phantom::PreparedPhantom;
use crate::engine::preview;
use crate::engine::primary_signal::PrimarySignal;
use crate::engine::scatter_field::ScatterField;
use crate::engine::single_scatter::SingleScatter;
use crate::engine::spectral_quadrature::{Accuracy, compressed};
use crate::image::radiograph::{CategorySums, Engine, Radiograph};
use crate::matter::scatter_density::ScatterDensities;
use crate::phantom::voxels::VoxelPhantom;
use crate::transport::tally::Category;
use crate::transport::tracking::TransportError;

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
/// Geometry, physics and units are those of [`crate::analog`].
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
    let prepared = PreparedPhantom::new(phantom, settings.compton_model);
    prepared.fast(spectrum, projection, settings)
}

impl PreparedPhantom<'_> {
    /// As [`crate::fast`], which prepares the phantom each time.
    ///
    /// # Errors
    /// As [`crate::fast`]; also when the settings name another Compton model than the phantom was prepared for.
    pub fn fast(
        &self,
        spectrum: &Spectrum,
        projection: &Projection,
        settings: &FastSettings,
    ) -> Result<Radiograph, TransportError> {
        self.check_model(settings.compton_model)?;
        expose(self, spectrum, projection, settings, &Monitor::silent())
    }

    /// As [`PreparedPhantom::fast`]; `observe` receives the share of the work that is done, about a hundred times and from any thread.
    ///
    /// The radiograph is the same, bit for bit, as without an observer. Once `observe` returns [`ControlFlow::Break`], the
    /// work ends within a few hundredths of its time.
    ///
    /// # Errors
    /// As [`PreparedPhantom::fast`]; [`TransportError::Cancelled`] after [`ControlFlow::Break`].
    pub fn fast_with_progress(
        &self,
        spectrum: &Spectrum,
        projection: &Projection,
        settings: &FastSettings,
        observe: &(dyn Fn(f64) -> ControlFlow<()> + Sync),
    ) -> Result<Radiograph, TransportError> {
        self.check_model(settings.compton_model)?;
        expose(self, spectrum, projection, settings, &Monitor::new(observe))
    }

    /// The same exposure on 96 to 191 pixels along the shorter side, or as many as the image has if they are fewer, with fewer rays and a thirty-second of the histories for the scatter.
    ///
    /// It takes less than a tenth of the time of [`PreparedPhantom::fast`], to be shown before that. Values and standard errors
    /// hold for its own, larger pixels; its detector begins in the same corner at low x and y.
    ///
    /// # Errors
    /// As [`PreparedPhantom::fast_with_progress`].
    pub fn preview(
        &self,
        spectrum: &Spectrum,
        projection: &Projection,
        settings: &FastSettings,
        observe: &(dyn Fn(f64) -> ControlFlow<()> + Sync),
    ) -> Result<Radiograph, TransportError> {
        let binned = Projection {
            detector: preview::detector(&projection.detector),
            receptor: preview::receptor(&projection.receptor, &projection.detector),
            ..projection.clone()
        };
        self.fast_with_progress(spectrum, &binned, &preview::settings(settings), observe)
    }
}

/// The exposure of a prepared phantom.
fn expose(
    phantom: &PreparedPhantom,
    spectrum: &Spectrum,
    projection: &Projection,
    settings: &FastSettings,
    monitor: &Monitor,
) -> Result<Radiograph, TransportError> {
    settings.validate(&projection.detector)?;
    let tables = phantom.tables();
    let exposure = Exposure::with_tables(tables.transport.clone(), spectrum, projection)?;
    let transport = &exposure.transport;
    let detector = &projection.detector;
    let paths = Paths::with_tables(transport, tables.paths.clone());
    let lines = compressed(&exposure, PRIMARY_ENERGIES);
    let mut primary = primary_moments(
        &exposure,
        &paths,
        lines.clone(),
        settings.samples_per_side,
        settings.dose_histories,
        monitor,
    );
    monitor.check()?;
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
        &tables.densities,
        settings,
        VarianceReduction::default(),
        monitor,
    );
    monitor.check()?;
    let [compton, rayleigh, _] = &scatter.fields;
    let mut shared = compton.covariance_kev2(rayleigh, detector);
    let mut scattered = scatter.fields.map(|field| field.on_pixels(detector));
    if let Some(marker) = &projection.marker {
        shade(marker, detector, &mut primary, &mut scattered, &mut shared);
    }
    let ShadowedPrimary {
        expected: primary,
        counted,
    } = grid_shadow::shadowed(&exposure, &paths, lines, primary);
    monitor.check()?;
    let primary_kev = primary.iter().map(|pixel| pixel.mean_kev).sum::<f64>();
    let sums = CategorySums::from_kev(|category| match category {
        Category::Primary => (primary_kev, 0.0),
        _ => scattered[category as usize - 1].sum_kev,
    });
    let readout = &exposure.readout;
    let columns = detector.columns as usize;
    let [compton, rayleigh, multiple] = scattered.map(|scatter| ExpectedLayer {
        counted: readout.displaced(&scatter.moments, columns),
        moments: scatter.moments,
        variance_kev2: scatter.variance_kev2,
    });
    let primary = ExpectedLayer {
        counted: readout
            .displaced(counted.as_ref().unwrap_or(&primary), columns)
            .or(counted),
        variance_kev2: vec![0.0; primary.len()],
        moments: primary,
    };
    let expected = [primary, compton, rayleigh, multiple];
    let ev_cm2 = 1e3 / detector.pixel_cm2();
    let drawn = noise::drawn(&expected, ev_cm2, settings.dose_histories, settings.seed);
    let image = Radiograph {
        detector: projection.detector,
        engine: Engine::Fast,
        histories: settings.dose_histories,
        histories_per_mas: transport.emitter.photons_per_mas(),
        seed: settings.seed,
        source_detector_mm: projection.source_detector_mm,
        open_field_ev_cm2,
        open_field,
        layers: readout.drawn(drawn, columns),
        single_scatter_covariance: shared
            .into_iter()
            .map(|kev2| (kev2 * ev_cm2 * ev_cm2) as f32)
            .collect(),
        electronic: None,
        sums,
        largest_score_share: Some(scatter.largest_share),
    };
    let image = image.with_gains(readout.gains());
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

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use super::*;
    use crate::beam::source::Collimation;
    use crate::engine::fast_progress::PRIMARY_DONE;
    use crate::engine::small_limb;
    use crate::matter::compton::ComptonModel;

    fn settings() -> FastSettings {
        FastSettings {
            scatter_histories: 64_000,
            ..FastSettings::default()
        }
    }

    /// Prepared once for two exposures and for each, observed or not: the same bytes.
    #[test]
    fn preparation_and_observers_change_no_byte() {
        let (phantom, spectrum, projection) = small_limb::exposure();
        let settings = settings();
        let alone = fast(&phantom, &spectrum, &projection, &settings).unwrap();
        let prepared = PreparedPhantom::new(phantom, settings.compton_model);
        let shares = Mutex::new(Vec::new());
        for _ in 0..2 {
            let image = prepared
                .fast_with_progress(&spectrum, &projection, &settings, &|share| {
                    shares.lock().unwrap().push(share);
                    ControlFlow::Continue(())
                })
                .unwrap();
            for category in Category::ALL {
                assert_eq!(alone.layer(category), image.layer(category));
            }
        }
        let mut shares = shares.into_inner().unwrap();
        shares.sort_by(f64::total_cmp);
        assert!(shares.len() > 100, "{shares:?}");
        let (first, last) = (shares[0], shares[shares.len() - 1]);
        assert!(first > 0.0 && (last - 1.0).abs() < 1e-9, "{shares:?}");
    }

    /// Rows whose first pixels lie in the shadow of the collimator count as well.
    #[test]
    fn a_collimated_primary_can_be_cancelled() {
        let (phantom, spectrum, mut projection) = small_limb::exposure();
        projection.source.collimation = Collimation::Rectangle {
            size_mm: [20.0; 2],
            centre_mm: [0.0; 2],
        };
        let prepared = PreparedPhantom::new(&phantom, ComptonModel::default());
        let first = Mutex::new(None);
        let result = prepared.fast_with_progress(&spectrum, &projection, &settings(), &|share| {
            first.lock().unwrap().get_or_insert(share);
            ControlFlow::Break(())
        });
        assert_eq!(result.err(), Some(TransportError::Cancelled));
        let first = first.into_inner().unwrap().unwrap();
        assert!(first < PRIMARY_DONE, "{first}");
    }

    /// Sums of scatter within 5 standard errors, three comparisons: a false alarm once in 6e5. The primary by fewer rays within 1 %.
    #[test]
    fn a_preview_agrees_with_its_image() {
        let (phantom, spectrum, projection) = small_limb::exposure();
        let prepared = PreparedPhantom::new(&phantom, ComptonModel::default());
        let image = prepared.fast(&spectrum, &projection, &settings()).unwrap();
        let preview = prepared
            .preview(&spectrum, &projection, &settings(), &|_| {
                ControlFlow::Continue(())
            })
            .unwrap();
        for category in Category::ALL {
            let ((a, se_a), (b, se_b)) = (image.sums.of(category), preview.sums.of(category));
            let error = (5.0 * se_a.hypot(se_b)).max(1e-2 * a);
            assert!(
                (a - b).abs() < error,
                "{category:?}: {a} ± {se_a}, {b} ± {se_b}"
            );
        }
    }

    /// Cancelled at the first report, and halfway through each kind of work.
    #[test]
    fn a_cancelled_exposure_ends_with_an_error() {
        let (phantom, spectrum, projection) = small_limb::exposure();
        let prepared = PreparedPhantom::new(&phantom, ComptonModel::default());
        for until in [0.0, 0.1, 0.3, 0.5, 0.8] {
            let last = Mutex::new(0.0_f64);
            let result =
                prepared.fast_with_progress(&spectrum, &projection, &settings(), &|share| {
                    let mut last = last.lock().unwrap();
                    *last = last.max(share);
                    if share >= until {
                        return ControlFlow::Break(());
                    }
                    ControlFlow::Continue(())
                });
            assert_eq!(result.err(), Some(TransportError::Cancelled));
            let last = last.into_inner().unwrap();
            assert!(
                last < until + 0.1,
                "cancelled at {until}, went on to {last}"
            );
        }
    }

    #[test]
    fn another_compton_model_is_refused() {
        let (phantom, spectrum, projection) = small_limb::exposure();
        let prepared = PreparedPhantom::new(&phantom, ComptonModel::IncoherentFunction);
        let settings = FastSettings {
            compton_model: ComptonModel::ImpulseApproximation,
            ..settings()
        };
        let error = prepared
            .fast(&spectrum, &projection, &settings)
            .unwrap_err();
        assert!(
            matches!(error, TransportError::ComptonModel { .. }),
            "{error}"
        );
    }
}
