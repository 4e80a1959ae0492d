//! Analog simulation of projections of MC-GPU input files.

use std::ops::ControlFlow;
use std::time::Duration;

use ppa_core::Part;

use crate::beam::projection::Projection;
use crate::dose::report::Dose;
use crate::engine::analog::AnalogSettings;
use crate::image::radiograph::Radiograph;
use crate::mcgpu::sections::RunLength;
use crate::mcgpu::simulation::Simulation;
use crate::mcgpu::trajectory::Station;
use crate::run::analog_run::AnalogRun;
use crate::run::progress::{Progress, Stop};
use crate::transport::tally::MOST_HISTORIES;
use crate::transport::tracking::TransportError;

impl Simulation {
    /// Follows the photons of a projection one by one and counts the doses that the input file requests.
    ///
    /// `observe` receives the progress a few times per second and ends the run early by [`ControlFlow::Break`]; the result is then
    /// what was counted so far. Otherwise the result depends only on the seed and the number of histories, which with a time limit
    /// depends on the machine.
    ///
    /// # Errors
    /// [`TransportError`] if the geometry, the spectrum or the number of histories is invalid.
    pub fn analog(
        &self,
        station: &Station,
        length: RunLength,
        mut observe: impl FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<(Radiograph, Option<Dose>), TransportError> {
        let projection = self.projection(station);
        let run = self.analog_run(station, &projection, length)?;
        let mut tally = run.tally(Part::WHOLE);
        run.follow(&mut tally, &stop(length), |_, progress| observe(progress))
            .expect("the tally is of this run");
        Ok((tally.radiograph(), tally.dose()))
    }

    /// Prepares the run of a projection, with the doses that the input file requests; [`stop`] ends it.
    pub(crate) fn analog_run<'a>(
        &'a self,
        station: &Station,
        projection: &'a Projection,
        length: RunLength,
    ) -> Result<AnalogRun<'a>, TransportError> {
        let settings = AnalogSettings {
            histories: match length {
                RunLength::Histories(histories) => histories,
                RunLength::Seconds(_) => MOST_HISTORIES,
            },
            seed: self.seed(station),
            ..AnalogSettings::default()
        };
        let run = AnalogRun::new(self.phantom(), self.spectrum(), projection, &settings)?;
        Ok(match self.dose_settings() {
            Some(dose) => run
                .with_dose(&dose)
                .expect("the dose region lies in the geometry"),
            None => run,
        })
    }
}

/// Stopping rule for a run of this length.
pub(crate) fn stop(length: RunLength) -> Stop {
    Stop {
        time: match length {
            RunLength::Histories(_) => None,
            RunLength::Seconds(seconds) => Some(Duration::from_secs_f64(seconds)),
        },
        ..Stop::default()
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use crate::mcgpu::input::Input;
    use crate::mcgpu::mangled;
    use crate::mcgpu::simulation::Simulation;

    use super::*;

    /// A box of 6 x 6 x 6 cm with water in air.
    fn voxels() -> String {
        let header =
            "[SECTION VOXELS HEADER v.2008-04-13]\n6 6 6\n1 1 1\n1\n2\n0\n[END OF VXH SECTION]\n";
        let line = |i: usize| {
            if i.is_multiple_of(5) {
                "1 0.0012\n"
            } else {
                "2 1.0\n"
            }
        };
        (0..216)
            .map(line)
            .fold(header.to_owned(), |text, line| text + line)
    }

    proptest::proptest! {
        /// A damaged scan is either refused or simulated to the end.
        #[test]
        fn a_damaged_scan_is_followed_or_refused(damage in mangled::damage(), hurt in 0..3_usize) {
            let folder = tempfile::tempdir().unwrap();
            // At most two changes to one of the files; with more, few files can be read.
            let damage = &damage[..damage.len().min(2)];
            let write = |index: usize, name: &str, text: &str| {
                let path = folder.path().join(name);
                let damage = if index == hurt { damage } else { &[] };
                fs::write(&path, mangled::damaged(text.as_bytes(), damage)).unwrap();
                path
            };
            let text = include_str!("sample.in")
                .replace("../beam.spc", "beam.spc")
                .replace("head.vox.gz", "head.vox")
                .replace("../materials/air.mcgpu.gz", "ppa:air")
                .replace("\n1 10 ", "\n1 5 ")
                .replace("\n2 11 ", "\n2 6 ")
                .replace("\n3 12 ", "\n3 6 ");
            let path = write(0, "scan.in", &text);
            write(1, "head.vox", &voxels());
            write(2, "beam.spc", "20000 1\n30000 2\n60000 -1\n");
            let Ok(read) = Input::read(&path) else {
                return Ok(());
            };
            let small = read.pixels.iter().all(|&pixels| pixels < 1_000);
            let Ok(simulation) = Simulation::with_input(read) else {
                return Ok(());
            };
            if small && let Some(station) = simulation.input().stations().first() {
                let _ = simulation.analog(station, RunLength::Histories(300), |_| {
                    ControlFlow::Continue(())
                });
            }
        }
    }
}
