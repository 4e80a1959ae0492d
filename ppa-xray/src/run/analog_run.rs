//! A run of the analog engine, in batches of histories separated by checks of the stopping rules.

use std::ops::ControlFlow;
#[cfg(feature = "files")]
use std::path::Path;
use std::sync::OnceLock;
use std::time::{Duration, Instant};

use ppa_core::Part;

use crate::beam::projection::Projection;
use crate::beam::spectrum::Spectrum;
use crate::dose::air_kerma::AirKerma;
use crate::dose::score::DoseTarget;
use crate::dose::settings::{DoseError, DoseSettings};
use crate::dose::setup::DoseSetup;
use crate::dose::voxel_labels::LabelNumbers;
use crate::engine::analog::{AnalogSettings, count, count_with_dose};
use crate::engine::analog_image::ImageSetup;
use crate::engine::exposure::Exposure;
use crate::phantom::voxels::VoxelPhantom;
use crate::run::analog_tally::{AnalogTally, RunSetup};
use crate::run::key::key;
use crate::run::progress::{Progress, Stop, Stopped, is_check, next_check};
#[cfg(feature = "files")]
use crate::run::tally_error::TallyError;
use crate::transport::tracking::{Transport, TransportError};

/// Approximate upper limit of the time between two checks.
const CHECK_EVERY: Duration = Duration::from_millis(250);

/// Histories of the first batch, before the rate is known.
const FIRST_BATCH: u64 = 16_384;

/// Smallest batch worth distributing over the threads.
const LEAST_BATCH: u64 = 1_024;

/// Why a tally cannot be continued.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum RunError {
    /// Phantom, spectrum, exposure, models, doses or seed differ.
    #[error(
        "the tally belongs to another simulation: phantom, spectrum, exposure, models, doses or seed differ (key {found}, expected {expected})"
    )]
    OtherTally {
        /// Key of the tally.
        found: String,
        /// Key of the run.
        expected: String,
    },
}

/// An exposure that is simulated photon by photon, in any number of parts.
///
/// The result depends only on the settings and on the histories counted: not on the number of
/// threads, on interruptions, or on how the run was split.
///
/// ```
/// # use nalgebra::{Isometry3, Point3, Vector3};
/// # use ppa_ct::Grid;
/// # use ppa_xray::*;
/// # let grid = Grid::axis_aligned([10; 3], Vector3::repeat(10.0), Point3::new(-45.0, -45.0, -45.0))?;
/// # let voxels = grid.len();
/// # let phantom = VoxelPhantom::new(grid, vec![0; voxels], vec![1.0; voxels], vec![Material::named("water")?])?;
/// # let spectrum = Spectrum::monoenergetic(60.0)?;
/// # let pose = Isometry3::translation(0.0, 0.0, -1000.0);
/// # let projection = Projection::new(pose, 1100.0, Detector::centred(10, 10, 10.0));
/// let settings = AnalogSettings::default().with_histories(1_000_000).with_seed(7);
/// let run = AnalogRun::new(&phantom, &spectrum, &projection, &settings)?.with_dose(&DoseSettings::default())?;
/// let mut tally = run.tally(Part::WHOLE);
/// let stop = Stop { relative_error: Some(0.05), ..Stop::default() };
/// run.follow(&mut tally, &stop, |_, progress| {
///     eprintln!("{} histories, {:?} left", progress.histories, progress.remaining);
///     std::ops::ControlFlow::Continue(())
/// })?;
/// let (radiograph, dose) = (tally.radiograph(), tally.dose().unwrap());
/// assert!(dose.phantom.ev_per_history.value > radiograph.sums.total_ev_per_history());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct AnalogRun<'a> {
    exposure: Exposure<'a>,
    settings: AnalogSettings,
    dose: Option<DoseCounting>,
    key: OnceLock<String>,
}

/// Data needed to count doses.
struct DoseCounting {
    settings: DoseSettings,
    setup: DoseSetup,
    air: AirKerma,
}

impl<'a> AnalogRun<'a> {
    /// Prepares a run of at most [`AnalogSettings::histories`].
    ///
    /// # Errors
    /// [`TransportError`] if the geometry, the spectrum or the number of histories is invalid.
    pub fn new(
        phantom: &'a VoxelPhantom,
        spectrum: &'a Spectrum,
        projection: &'a Projection,
        settings: &AnalogSettings,
    ) -> Result<Self, TransportError> {
        settings.validate()?;
        Ok(Self {
            exposure: Exposure::new(phantom, spectrum, projection, settings.compton_model)?,
            settings: *settings,
            dose: None,
            key: OnceLock::new(),
        })
    }

    /// Counts doses as well, which is slightly slower.
    ///
    /// # Errors
    /// [`DoseError`] for a region that extends beyond the phantom.
    pub fn with_dose(self, settings: &DoseSettings) -> Result<Self, DoseError> {
        let setup = DoseSetup::new(&self.exposure.transport, settings)?;
        Ok(Self {
            dose: Some(DoseCounting {
                settings: settings.clone(),
                setup,
                air: AirKerma::new(),
            }),
            key: OnceLock::new(),
            ..self
        })
    }

    /// An empty tally for a part of the histories.
    pub fn tally(&self, part: Part) -> AnalogTally {
        let setup = RunSetup {
            key: self.key().to_owned(),
            seed: self.settings.seed,
            histories: self.settings.histories,
            image: ImageSetup::new(&self.exposure),
            dose: self.dose.as_ref().map(|dose| dose.setup.clone()),
        };
        AnalogTally::empty(setup, part.share(self.settings.histories))
    }

    /// Reads the tally of an earlier, interrupted run to continue it. The tally of a whole run may continue to another number of histories.
    ///
    /// # Errors
    /// [`TallyError`] if the file cannot be read, is damaged, or belongs to another simulation or part.
    #[cfg(feature = "files")]
    pub fn read(&self, path: &Path, part: Part) -> Result<AnalogTally, TallyError> {
        self.resume(AnalogTally::read(path)?, path, part)
    }

    /// The same as [`Self::read`] for a tally already read from `path`.
    #[cfg(feature = "files")]
    pub(crate) fn resume(
        &self,
        mut tally: AnalogTally,
        path: &Path,
        part: Part,
    ) -> Result<AnalogTally, TallyError> {
        self.check_key(&tally, path)?;
        let (histories, share) = (self.settings.histories, part.share(self.settings.histories));
        if tally.is_whole_run() && part == Part::WHOLE && tally.done.end <= histories {
            tally.setup.histories = histories;
            tally.part = share;
            return Ok(tally);
        }
        self.check_histories(&tally, path)?;
        if tally.part != share {
            return Err(TallyError::Part {
                path: path.into(),
                found: tally.part,
                expected: share,
            });
        }
        Ok(tally)
    }

    /// Returns an error if the tally, read from `path`, does not cover all histories of this run.
    #[cfg(feature = "files")]
    pub(crate) fn check_whole(&self, tally: &AnalogTally, path: &Path) -> Result<(), TallyError> {
        self.check_key(tally, path)?;
        self.check_histories(tally, path)
    }

    #[cfg(feature = "files")]
    fn check_key(&self, tally: &AnalogTally, path: &Path) -> Result<(), TallyError> {
        match tally.setup.key == self.key() {
            true => Ok(()),
            false => Err(TallyError::Key {
                path: path.into(),
                found: tally.setup.key.clone(),
                expected: self.key().to_owned(),
            }),
        }
    }

    #[cfg(feature = "files")]
    fn check_histories(&self, tally: &AnalogTally, path: &Path) -> Result<(), TallyError> {
        match tally.setup.histories == self.settings.histories {
            true => Ok(()),
            false => Err(TallyError::Histories {
                path: path.into(),
                found: tally.setup.histories,
                expected: self.settings.histories,
            }),
        }
    }

    /// SHA-256 of everything that determines the result of a history.
    pub(crate) fn key(&self) -> &str {
        self.key.get_or_init(|| {
            let Transport {
                tables,
                spectrum,
                projection,
                ..
            } = &self.exposure.transport;
            let dose = self.dose.as_ref().map(|dose| &dose.settings);
            key(&tables.phantom, spectrum, projection, &self.settings, dose)
        })
    }

    /// Follows the histories missing from `tally` until `stop` or the observer ends the run.
    ///
    /// `observe` receives the progress a few times per second and ends the run by [`ControlFlow::Break`]. Whenever it
    /// is called and at the end, the tally is consistent and may be written. If [`Stop`] ends a run that is not in
    /// parts, the run is complete with the histories counted so far.
    ///
    /// # Errors
    /// [`RunError`] if `tally` belongs to another run.
    pub fn follow(
        &self,
        tally: &mut AnalogTally,
        stop: &Stop,
        mut observe: impl FnMut(&AnalogTally, &Progress) -> ControlFlow<()>,
    ) -> Result<Stopped, RunError> {
        if tally.setup.key != self.key() {
            return Err(RunError::OtherTally {
                found: tally.setup.key.clone(),
                expected: self.key().to_owned(),
            });
        }
        let start = Instant::now();
        let first = tally.done.end;
        let mut batch = FIRST_BATCH;
        let mut relative_error = None;
        loop {
            let counted = tally.done.end - tally.done.start;
            if let Some(target) = stop.relative_error
                && is_check(counted)
            {
                let error = tally.relative_error();
                relative_error = Some(error);
                if error <= target {
                    tally.end_here();
                    return Ok(Stopped::Precise);
                }
            }
            let left = tally.part.end - tally.done.end;
            if left == 0 {
                return Ok(Stopped::Complete);
            }
            let elapsed = start.elapsed();
            let rate = (tally.done.end - first) as f64 / elapsed.as_secs_f64();
            if tally.done.end > first {
                let progress = foresee(tally, stop, relative_error, elapsed, rate);
                if observe(tally, &progress).is_break() {
                    return Ok(Stopped::Interrupted);
                }
                if stop.time.is_some_and(|time| elapsed >= time) {
                    tally.end_here();
                    return Ok(Stopped::Time);
                }
                let until = stop
                    .time
                    .map_or(CHECK_EVERY, |time| CHECK_EVERY.min(time - elapsed));
                // The rate is unreliable at first, so limit the growth.
                batch = ((rate * until.as_secs_f64()) as u64).clamp(LEAST_BATCH, 2 * batch);
            }
            let mut end = tally.done.end + left.min(batch);
            if stop.relative_error.is_some() {
                end = end.min(tally.done.start.saturating_add(next_check(counted)));
            }
            self.count(tally, end);
        }
    }

    /// Counts the histories up to `end`.
    fn count(&self, tally: &mut AnalogTally, end: u64) {
        let histories = tally.done.end..end;
        let (exposure, seed) = (&self.exposure, self.settings.seed);
        match (&self.dose, &tally.dose) {
            (
                Some(DoseCounting {
                    setup,
                    air,
                    settings,
                }),
                Some(dose),
            ) => {
                let labels = settings.labels.as_ref();
                let target = DoseTarget {
                    phantom: &exposure.transport.tables.phantom,
                    regions: &setup.regions(),
                    labels: labels.map(|labels| (&*labels.0, LabelNumbers::of(&setup.labels()))),
                    tally: dose,
                    air,
                    raster: tally.image.raster,
                };
                count_with_dose(exposure, seed, histories, &tally.image, &target);
            }
            _ => count(exposure, seed, histories, &tally.image),
        }
        tally.done.end = end;
    }
}

/// Estimates the rest of a run: until the first of all stopping rules applies.
fn foresee(
    tally: &AnalogTally,
    stop: &Stop,
    relative_error: Option<f64>,
    elapsed: Duration,
    rate: f64,
) -> Progress {
    let counted = (tally.done.end - tally.done.start) as f64;
    let mut expected = (tally.part.end - tally.part.start) as f64;
    if let Some(time) = stop.time {
        expected = expected.min(counted + rate * time.saturating_sub(elapsed).as_secs_f64());
    }
    if let (Some(target), Some(error)) = (stop.relative_error, relative_error) {
        // The error falls as one over the square root of the histories.
        expected = expected.min(counted * (error / target).powi(2));
    }
    let remaining_s = (expected - counted).max(0.0) / rate;
    Progress {
        histories: counted as u64,
        expected_histories: expected.max(counted) as u64,
        elapsed,
        remaining: Duration::try_from_secs_f64(remaining_s).ok(),
        relative_error,
    }
}
