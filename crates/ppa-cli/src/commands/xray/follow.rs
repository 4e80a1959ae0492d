//! The analog engine at work: until when, in which part, with which doses.

use std::ops::ControlFlow;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use anyhow::Context;
use clap::Args;
use ppa_xray::{
    AnalogRun, AnalogSettings, AnalogTally, DoseSettings, Part, Projection, Spectrum, Stop,
    VoxelBox, VoxelPhantom,
};

use crate::output::bar;

/// Time between two saved states of a run, at most what an interruption costs.
const SAVE_EVERY: Duration = Duration::from_secs(60);

#[derive(Debug, Args)]
#[command(next_help_heading = "Analog engine")]
pub struct AnalogArgs {
    /// Stop after this many seconds
    #[arg(long, value_name = "SECONDS")]
    time: Option<f64>,
    /// Stop when half of the pixels have a relative standard error below this, percent
    #[arg(long, value_name = "PERCENT")]
    target_error: Option<f64>,
    /// Follow part k of n only; `ppa xray merge` joins the tallies of all parts
    #[arg(long, value_name = "K/N", requires = "tally", conflicts_with_all = ["time", "target_error"])]
    part: Option<Part>,
    /// Keep the sums in this file: saved every minute and at the end, to resume from and to merge
    #[arg(long, value_name = "FILE")]
    pub tally: Option<PathBuf>,
    /// Go on from the tally file, if it is there
    #[arg(long, requires = "tally")]
    resume: bool,
    /// Tell the energy imparted to every material and the air kerma
    #[arg(long)]
    dose: bool,
    /// Absorbed dose to write, µGy per mAs in every voxel: NIfTI, .nii or .nii.gz
    #[arg(long, value_name = "FILE")]
    pub dose_map: Option<PathBuf>,
}

impl AnalogArgs {
    /// The first option that only the analog engine knows.
    pub fn given(&self) -> Option<&'static str> {
        let options = [
            (self.time.is_some(), "--time"),
            (self.target_error.is_some(), "--target-error"),
            (self.part.is_some(), "--part"),
            (self.tally.is_some(), "--tally"),
            (self.resume, "--resume"),
            (self.dose, "--dose"),
            (self.dose_map.is_some(), "--dose-map"),
        ];
        options
            .into_iter()
            .find(|(given, _)| *given)
            .map(|(_, name)| name)
    }

    /// Follows photons under a progress bar.
    pub fn follow(
        &self,
        phantom: &VoxelPhantom,
        spectrum: &Spectrum,
        projection: &Projection,
        histories: Option<f64>,
        seed: u64,
    ) -> anyhow::Result<AnalogTally> {
        let stop = self.stop()?;
        let settings = AnalogSettings {
            histories: match histories {
                Some(histories) => whole_number(histories)?,
                None if stop == Stop::default() => AnalogSettings::default().histories,
                None => AnalogSettings::MOST_HISTORIES,
            },
            seed,
            ..AnalogSettings::default()
        };
        let mut run = AnalogRun::new(phantom, spectrum, projection, &settings)?;
        if self.dose || self.dose_map.is_some() {
            let whole = VoxelBox::whole(phantom.grid());
            run = run.with_dose(&DoseSettings {
                regions: Vec::new(),
                voxels: self.dose_map.is_some().then_some(whole),
            })?;
        }
        let mut tally = self.start(&run)?;
        let bar = bar("following photons");
        let mut saved = Instant::now();
        let mut failed = None;
        run.follow(&mut tally, &stop, |tally, progress| {
            bar.set_length(progress.expected_histories);
            bar.set_position(progress.histories);
            if let Some(path) = &self.tally
                && saved.elapsed() > SAVE_EVERY
            {
                saved = Instant::now();
                if let Err(error) = tally.write(path) {
                    failed = Some(error);
                    return ControlFlow::Break(());
                }
            }
            ControlFlow::Continue(())
        });
        bar.finish_and_clear();
        if let Some(error) = failed {
            return Err(error.into());
        }
        if let Some(path) = &self.tally {
            tally.write(path)?;
        }
        Ok(tally)
    }

    /// The tally to begin with.
    fn start(&self, run: &AnalogRun) -> anyhow::Result<AnalogTally> {
        let part = self.part.unwrap_or(Part::WHOLE);
        let Some(path) = &self.tally else {
            return Ok(run.tally(part));
        };
        let exists = path
            .try_exists()
            .with_context(|| format!("cannot read {}", path.display()))?;
        if !exists {
            let tally = run.tally(part);
            // Rather now than after hours.
            tally.write(path)?;
            return Ok(tally);
        }
        anyhow::ensure!(
            self.resume,
            "{} exists: go on from it with --resume, or remove it",
            path.display()
        );
        Ok(run.read(path, part)?)
    }

    fn stop(&self) -> anyhow::Result<Stop> {
        if let Some(seconds) = self.time {
            anyhow::ensure!(
                seconds > 0.0 && seconds <= 1e9,
                "--time is {seconds}, expected seconds above 0 and up to 1e9"
            );
        }
        if let Some(percent) = self.target_error {
            anyhow::ensure!(
                percent > 0.0 && percent < 100.0,
                "--target-error is {percent}, expected percent between 0 and 100"
            );
        }
        Ok(Stop {
            time: self.time.map(Duration::from_secs_f64),
            relative_error: self.target_error.map(|percent| percent / 100.0),
        })
    }
}

fn whole_number(histories: f64) -> anyhow::Result<u64> {
    let most = AnalogSettings::MOST_HISTORIES as f64;
    anyhow::ensure!(
        (1.0..=most).contains(&histories),
        "--histories is {histories}, expected 1 to {most:e} for the analog engine"
    );
    Ok(histories as u64)
}
