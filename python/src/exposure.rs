//! Exposures by either engine: their settings, and their simulation outside the interpreter.

use std::ops::ControlFlow;
use std::time::Duration;

use ppa_generate::{ExposureError, XraySettings};
use ppa_scene::PlaceError;
use ppa_xray::{
    AnalogRun, AnalogSettings, Dose, DoseError, DoseSettings, FastSettings, Part, PreparedPhantom,
    Projection, Radiograph, RunError, Spectrum, Stop, TransportError, TubeLoad, VoxelBox,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyBool;

use crate::background::Watch;
use crate::posable_case::ExposableError;

/// Why an exposure cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum ExposeError {
    #[error(transparent)]
    Limb(#[from] ExposableError),
    #[error(transparent)]
    Settings(#[from] ExposureError),
    #[error(transparent)]
    Place(#[from] PlaceError),
    #[error(transparent)]
    Transport(#[from] TransportError),
    #[error(transparent)]
    Run(#[from] RunError),
    #[error(transparent)]
    Dose(#[from] DoseError),
}

/// Which doses are scored.
#[derive(Clone, Copy, PartialEq)]
enum Doses {
    None,
    Materials,
    Voxels,
}

/// Settings of one exposure.
pub enum Exposure {
    /// Ray-traced primary, Monte Carlo scatter, added noise.
    Fast { seed: u64 },
    /// Analog Monte Carlo.
    Analog(Analog),
}

/// A run of the analog engine.
pub struct Analog {
    settings: AnalogSettings,
    stop: Stop,
    doses: Doses,
}

impl Exposure {
    pub fn new(
        engine: &str,
        histories: Option<f64>,
        target_error: Option<f64>,
        seconds: Option<f64>,
        dose: Option<&Bound<'_, PyAny>>,
        seed: u64,
    ) -> PyResult<Self> {
        let doses = match dose {
            None => Doses::None,
            Some(dose) if dose.is_instance_of::<PyBool>() => match dose.extract()? {
                true => Doses::Materials,
                false => Doses::None,
            },
            Some(dose) if dose.extract::<&str>().is_ok_and(|text| text == "map") => Doses::Voxels,
            Some(dose) => {
                return Err(PyValueError::new_err(format!(
                    "dose is {}, expected True, False or \"map\"",
                    dose.repr()?
                )));
            }
        };
        match engine {
            "fast" => {
                for (name, given) in [
                    ("target_error", target_error.is_some()),
                    ("seconds", seconds.is_some()),
                    ("dose", doses != Doses::None),
                ] {
                    if given {
                        return Err(PyValueError::new_err(format!(
                            "{name} needs engine=\"analog\""
                        )));
                    }
                }
                Ok(Self::Fast { seed })
            }
            "analog" => Ok(Self::Analog(Analog {
                settings: analog_settings(histories, target_error.or(seconds).is_some(), seed)?,
                stop: stop(target_error, seconds)?,
                doses,
            })),
            _ => Err(PyValueError::new_err(format!(
                "engine is {engine:?}, expected \"fast\" or \"analog\""
            ))),
        }
    }

    /// Writes the tube load into the settings of a fast exposure.
    pub fn load(
        &self,
        settings: &mut XraySettings,
        histories: Option<f64>,
        mas: Option<f64>,
        exposure_index: Option<f64>,
    ) -> PyResult<()> {
        let given = [histories.is_some(), mas.is_some(), exposure_index.is_some()];
        if given.iter().filter(|given| **given).count() > 1 {
            return Err(PyValueError::new_err(
                "histories, mas and exposure_index are mutually exclusive: give only one of them",
            ));
        }
        settings.analog = None; // The engine is an argument of the call.
        let load = mas.map(TubeLoad::Mas);
        let load = load.or(exposure_index.map(TubeLoad::ExposureIndex));
        if load.is_some() && matches!(self, Self::Analog(_)) {
            return Err(PyValueError::new_err(
                "mas and exposure_index need engine=\"fast\": analog histories are followed one by one",
            ));
        }
        if let Some(load) = &load {
            load.check()
                .map_err(|error| PyValueError::new_err(error.to_string()))?;
        }
        settings.tube_load = load.or(settings.tube_load);
        if let (Self::Fast { .. }, Some(histories)) = (self, histories) {
            settings.engine.dose_histories = histories;
            settings.tube_load = None;
        }
        Ok(())
    }
}

/// Simulates a fast exposure and reports its progress.
pub fn fast(
    phantom: &PreparedPhantom,
    spectrum: &Spectrum,
    projection: &Projection,
    settings: &FastSettings,
    watch: &Watch,
) -> Result<Radiograph, TransportError> {
    let observe = |share: f64| watch.report(share, 1.0);
    phantom.fast_with_progress(spectrum, projection, settings, &observe)
}

impl Analog {
    /// Follows photons until all histories are done or a limit is reached.
    pub fn follow(
        &self,
        phantom: &PreparedPhantom,
        spectrum: &Spectrum,
        projection: &Projection,
        watch: &Watch,
    ) -> Result<(Radiograph, Option<Dose>), ExposeError> {
        let phantom = phantom.phantom();
        let mut run = AnalogRun::new(phantom, spectrum, projection, &self.settings)?;
        if self.doses != Doses::None {
            let map = self.doses == Doses::Voxels;
            let voxels = map.then(|| VoxelBox::whole(phantom.grid()));
            run = run.with_dose(&DoseSettings::default().with_voxels(voxels))?;
        }
        let mut tally = run.tally(Part::WHOLE);
        run.follow(&mut tally, &self.stop, |_, progress| -> ControlFlow<()> {
            watch.report(
                progress.histories as f64,
                progress.expected_histories as f64,
            )
        })?;
        Ok((tally.radiograph(), tally.dose()))
    }
}

fn analog_settings(histories: Option<f64>, limited: bool, seed: u64) -> PyResult<AnalogSettings> {
    let most = AnalogSettings::MOST_HISTORIES;
    let histories = match histories {
        Some(histories) if (1.0..=most as f64).contains(&histories) => histories as u64,
        Some(histories) => {
            return Err(PyValueError::new_err(format!(
                "histories is {histories}, expected 1 to {:e} for the analog engine",
                most as f64
            )));
        }
        None if limited => most,
        None => AnalogSettings::default().histories,
    };
    Ok(AnalogSettings::default()
        .with_histories(histories)
        .with_seed(seed))
}

fn stop(target_error: Option<f64>, seconds: Option<f64>) -> PyResult<Stop> {
    if let Some(seconds) = seconds
        && !(seconds > 0.0 && seconds <= 1e9)
    {
        return Err(PyValueError::new_err(format!(
            "seconds is {seconds}, expected more than 0 and up to 1e9"
        )));
    }
    if let Some(error) = target_error
        && !(error > 0.0 && error < 1.0)
    {
        return Err(PyValueError::new_err(format!(
            "target_error is {error}, expected a share between 0 and 1, such as 0.02"
        )));
    }
    Ok(Stop {
        time: seconds.map(Duration::from_secs_f64),
        relative_error: target_error,
    })
}
