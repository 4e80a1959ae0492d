//! The analog engine on projections of MC-GPU input files.

use std::ops::ControlFlow;
use std::time::Duration;

use crate::dose::report::Dose;
use crate::engine::analog::AnalogSettings;
use crate::image::radiograph::Radiograph;
use crate::mcgpu::sections::RunLength;
use crate::mcgpu::simulation::Simulation;
use crate::mcgpu::trajectory::Station;
use crate::run::analog_run::AnalogRun;
use crate::run::part::Part;
use crate::run::progress::{Progress, Stop};
use crate::transport::tally::MOST_HISTORIES;
use crate::transport::tracking::TransportError;

impl Simulation {
    /// Follows the photons of a projection one by one, and counts the doses that the input file asks for.
    ///
    /// `observe` hears of the progress a few times per second. The result depends on seed and number of histories only;
    /// how many fit into a time depends on the machine.
    ///
    /// # Errors
    /// [`TransportError`] when the geometry, the spectrum or the number of histories makes no sense.
    pub fn analog(
        &self,
        station: &Station,
        length: RunLength,
        mut observe: impl FnMut(&Progress),
    ) -> Result<(Radiograph, Option<Dose>), TransportError> {
        let (histories, stop) = match length {
            RunLength::Histories(histories) => (histories, Stop::default()),
            RunLength::Seconds(seconds) => {
                let time = Some(Duration::from_secs_f64(seconds));
                (
                    MOST_HISTORIES,
                    Stop {
                        time,
                        ..Stop::default()
                    },
                )
            }
        };
        let settings = AnalogSettings {
            histories,
            seed: self.seed(station),
            ..AnalogSettings::default()
        };
        let projection = self.projection(station);
        let mut run = AnalogRun::new(self.phantom(), self.spectrum(), &projection, &settings)?;
        if let Some(dose) = self.dose_settings() {
            run = run
                .with_dose(&dose)
                .expect("the dose region lies in the geometry");
        }
        let mut tally = run.tally(Part::WHOLE);
        run.follow(&mut tally, &stop, |_, progress| {
            observe(progress);
            ControlFlow::Continue(())
        });
        Ok((tally.radiograph(), tally.dose()))
    }
}
