//! The fast engine: ray-traced primary, next-event estimation (forced detection) of scatter, quantum noise.
//!
//! docs/physics.md, "Fast engine". Forced detection: Kalos, Nucl. Sci. Eng. 16 (1963) 111; Williamson, Med. Phys. 14 (1987) 567.

use std::ops::ControlFlow;

use crate::beam::projection::Projection;
use crate::beam::spectrum::Spectrum;
use crate::detector::open_field::OpenField;
use crate::engine::expected_image::ExpectedImage;
use crate::engine::exposure::Exposure;
use crate::engine::fast_progress::Observer;
use crate::engine::fast_settings::FastSettings;
use crate::engine::grid_shadow::{self, ShadowedPrimary};
use crate::engine::marker_shadow::shade;
use crate::engine::noise::{self, ExpectedLayer};
use crate::engine::prepared_phantom::PreparedPhantom;
use crate::engine::preview;
use crate::image::radiograph::{CategorySums, Engine, Radiograph};
use crate::phantom::voxels::VoxelPhantom;
use crate::transport::tally::Category;
use crate::transport::tracking::TransportError;

/// Simulates a radiograph of [`FastSettings::dose_histories`] photons at a fraction of the cost of following them.
///
/// Geometry, physics and units are those of [`crate::analog`].
/// Primary: line integrals averaged over each pixel.
/// Scatter, which varies slowly: forced detection at points of the detector, which are denser where the scatter is curved, and cubic
/// interpolation to the pixels. Every layer then gets the noise of an energy-integrating detector. The standard errors
/// include this noise and the error of the scatter estimate, which neighbouring pixels share.
///
/// # Errors
/// [`TransportError`] if the geometry, the spectrum or a setting is invalid.
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
    /// The same as [`crate::fast`], without preparing the phantom each time.
    ///
    /// # Errors
    /// The same as [`crate::fast`]; also if the settings name another Compton model than the phantom was prepared for.
    pub fn fast(
        &self,
        spectrum: &Spectrum,
        projection: &Projection,
        settings: &FastSettings,
    ) -> Result<Radiograph, TransportError> {
        self.check_model(settings.compton_model)?;
        let unobserved = |_| ControlFlow::Continue(());
        expose(self, spectrum, projection, settings, &unobserved)
    }

    /// The same as [`PreparedPhantom::fast`], with progress reports: `observe` receives the completed share of the work at each percent and
    /// about every 100 ms in between, from any thread.
    ///
    /// The radiograph is bit-identical to one without an observer. Once `observe` returns [`ControlFlow::Break`], each thread finishes its
    /// current row, node or histories (at most 8192).
    ///
    /// # Errors
    /// The same as [`PreparedPhantom::fast`]; [`TransportError::Cancelled`] after [`ControlFlow::Break`].
    pub fn fast_with_progress(
        &self,
        spectrum: &Spectrum,
        projection: &Projection,
        settings: &FastSettings,
        observe: &(dyn Fn(f64) -> ControlFlow<()> + Sync),
    ) -> Result<Radiograph, TransportError> {
        self.check_model(settings.compton_model)?;
        expose(self, spectrum, projection, settings, observe)
    }

    /// The same exposure on 96 to 191 pixels along the shorter side, or as many as the image has if they are fewer, with fewer rays and a
    /// thirty-second of the histories for the scatter.
    ///
    /// It takes less than a tenth of the time of [`PreparedPhantom::fast`] and can be shown before it. Values and standard
    /// errors apply to its own, larger pixels. Its detector begins in the same corner at low x and y.
    ///
    /// # Errors
    /// The same as [`PreparedPhantom::fast_with_progress`].
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
    observe: Observer,
) -> Result<Radiograph, TransportError> {
    settings.check(&projection.detector)?;
    let tables = phantom.tables();
    let exposure = Exposure::with_tables(tables.transport.clone(), spectrum, projection)?;
    let transport = &exposure.transport;
    let detector = &projection.detector;
    let (open_field, open_field_ev_cm2) = OpenField::of(transport, &exposure.response);
    let open_kev = open_field_ev_cm2 * detector.pixel_cm2() / 1e3;
    let ExpectedImage {
        mut primary,
        mut scattered,
        mut shared,
        largest_share,
    } = ExpectedImage::of_all_photons(&exposure, tables, settings, open_kev, observe)?;
    if let Some(marker) = &projection.marker {
        shade(marker, detector, &mut primary, &mut scattered, &mut shared);
    }
    let ShadowedPrimary {
        expected: primary,
        counted,
    } = grid_shadow::shadowed(&exposure, &tables.paths, primary);
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
        histories_per_mas: transport.histories_per_mas(),
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
        largest_score_share: Some(largest_share),
    };
    let image = image.with_gains(readout.gains());
    Ok(image.with_electronic_noise(readout.electronic_noise_kev()))
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

    /// Results do not depend on sharing a prepared phantom between two exposures, nor on an observer.
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

    /// Rows whose first pixels are in the shadow of the collimator are counted as well.
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
