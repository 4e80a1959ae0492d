//! Runs of the analog engine: stopping rule, parts, doses.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::Context;
use clap::Args;
use ppa_generate::{ExposableLimb, PosedExposure};
use ppa_xray::{
    AnalogRun, AnalogSettings, AnalogTally, DoseSettings, Part, Stop, Stopped, VoxelBox,
};

use super::divisible::refuse_given;
use crate::interrupt::Interrupt;
use crate::output::bar;
use crate::output_files::{OutputFiles, ReplaceArgs, require_room};

/// Time between two saved states of a run, the most that an interruption can lose.
pub(super) const SAVE_EVERY: Duration = Duration::from_secs(60);

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
    /// Keep the tallies in this file: saved every minute and at the end, to resume from and to merge. Without it, a run stopped by Ctrl-C
    /// or TERM leaves them next to the first image, as x.png.tally
    #[arg(long, value_name = "FILE")]
    pub tally: Option<PathBuf>,
    /// Resume from the tally file, if it exists, and replace the images of the earlier run
    #[arg(long, requires = "tally")]
    resume: bool,
    /// Report the energy imparted to every material and the air kerma
    #[arg(long)]
    dose: bool,
    /// Absorbed dose to write, µGy per mAs in every voxel: NIfTI, .nii or .nii.gz
    #[arg(long, value_name = "FILE")]
    pub dose_map: Option<PathBuf>,
}

/// Where the tallies of a run are stored.
pub struct TallyDestination {
    path: PathBuf,
    /// Set by `--tally`; otherwise the tallies are kept only if the run is stopped.
    named: bool,
}

impl TallyDestination {
    fn folder(&self) -> &Path {
        match self.path.parent() {
            Some(folder) if !folder.as_os_str().is_empty() => folder,
            _ => Path::new("."),
        }
    }
}

impl AnalogArgs {
    /// Declares tally and dose map, and chooses where the tallies are kept if the run is stopped; `image` is its first image.
    pub fn declare(
        &self,
        outputs: &mut OutputFiles,
        image: Option<&Path>,
        replace: ReplaceArgs,
    ) -> anyhow::Result<TallyDestination> {
        outputs.optional("--dose-map", self.dose_map.as_ref(), &[".nii", ".nii.gz"])?;
        let replace = replace.is_given();
        if let Some(path) = &self.tally {
            let exists = path
                .try_exists()
                .with_context(|| format!("cannot read {}", path.display()))?;
            if exists && !self.resume {
                anyhow::ensure!(
                    replace,
                    "{} exists: continue it with --resume, or give --replace to start again",
                    path.display()
                );
            }
            if !exists || !self.resume {
                outputs.file("--tally", path, &[])?;
            }
            return Ok(TallyDestination {
                path: path.clone(),
                named: true,
            });
        }
        let beside = image.or(self.dose_map.as_deref());
        let beside = beside.context("no output was specified")?;
        let mut path = beside.as_os_str().to_owned();
        path.push(".tally");
        let path = PathBuf::from(path);
        anyhow::ensure!(
            replace || !path.exists(),
            "{0} contains the histories of a run that was stopped: continue it with --tally {0} --resume, or give --replace to \
             begin again",
            path.display()
        );
        outputs.file("the tally", &path, &[])?;
        Ok(TallyDestination { path, named: false })
    }

    /// Whether an earlier run is resumed.
    pub fn goes_on(&self) -> bool {
        self.resume && self.tally.as_ref().is_some_and(|tally| tally.exists())
    }

    /// The first given option that only the analog engine supports.
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

    /// Refuses options that are not allowed for a command whose histories are divided.
    pub fn check_divisible(&self) -> anyhow::Result<()> {
        refuse_given(&[
            ("--time", self.time.is_some()),
            ("--target-error", self.target_error.is_some()),
            ("--part", self.part.is_some()),
            ("--tally", self.tally.is_some()),
            ("--resume", self.resume),
        ])
    }

    /// Largest number of histories to simulate; `given` is the value of `--histories`.
    pub fn histories(&self, given: Option<f64>) -> anyhow::Result<u64> {
        match given {
            Some(histories) => whole_number(histories),
            None if self.stop()? == Stop::default() => Ok(AnalogSettings::default().histories),
            None => Ok(AnalogSettings::MOST_HISTORIES),
        }
    }

    /// The run of an exposure, with the requested doses.
    pub fn run<'a>(
        &self,
        exposure: &'a PosedExposure,
        histories: u64,
        seed: u64,
    ) -> anyhow::Result<AnalogRun<'a>> {
        let settings = AnalogSettings::default()
            .with_histories(histories)
            .with_seed(seed);
        let ExposableLimb {
            phantom, spectrum, ..
        } = exposure.limb;
        let phantom = phantom.phantom();
        let run = AnalogRun::new(phantom, spectrum, &exposure.projection, &settings)?;
        if !self.dose && self.dose_map.is_none() {
            return Ok(run);
        }
        let whole = VoxelBox::whole(phantom.grid());
        let voxels = self.dose_map.is_some().then_some(whole);
        Ok(run.with_dose(&DoseSettings::default().with_voxels(voxels))?)
    }

    /// Simulates photons with a progress bar. Ctrl-C and TERM keep the tallies and end the command.
    pub fn follow(
        &self,
        exposure: &PosedExposure,
        histories: Option<f64>,
        seed: u64,
        destination: &TallyDestination,
    ) -> anyhow::Result<AnalogTally> {
        let stop = self.stop()?;
        let run = self.run(exposure, self.histories(histories)?, seed)?;
        let mut tally = self.start(&run, destination)?;
        let interrupt = Interrupt::listen()?;
        let bar = bar("following photons");
        let mut saved = Instant::now();
        let mut failed = None;
        let mut counted = 0;
        let ended = run.follow(&mut tally, &stop, |tally, progress| {
            bar.set_length(progress.expected_histories);
            bar.set_position(progress.histories);
            counted = progress.histories;
            if interrupt.is_asked() {
                return ControlFlow::Break(());
            }
            if destination.named && saved.elapsed() > SAVE_EVERY {
                saved = Instant::now();
                if let Err(error) = tally.write(&destination.path) {
                    failed = Some(error);
                    return ControlFlow::Break(());
                }
            }
            ControlFlow::Continue(())
        });
        bar.finish_and_clear();
        let ended = ended?;
        if let Some(error) = failed {
            return Err(error.into());
        }
        if destination.named || ended == Stopped::Interrupted {
            tally.write(&destination.path)?;
        }
        if ended == Stopped::Interrupted {
            let path = destination.path.display();
            let more = match (destination.named, self.resume) {
                (false, _) => format!(" with --tally {path} --resume"),
                (true, false) => " with --resume".to_owned(),
                (true, true) => String::new(),
            };
            return Err(interrupt.stopped(format!(
                "after {counted} histories, which are kept in {path}; repeat the command{more} to resume"
            )));
        }
        Ok(tally)
    }

    /// The tally to start from.
    fn start(
        &self,
        run: &AnalogRun,
        destination: &TallyDestination,
    ) -> anyhow::Result<AnalogTally> {
        let part = self.part.unwrap_or(Part::WHOLE);
        let there = destination.named && destination.path.exists();
        if there && self.resume {
            return Ok(run.read(&destination.path, part)?);
        }
        let tally = run.tally(part);
        require_room(destination.folder(), tally.file_bytes())?;
        if destination.named && !there {
            // Finds out now rather than after hours whether it can be written.
            tally.write(&destination.path)?;
        }
        Ok(tally)
    }

    fn stop(&self) -> anyhow::Result<Stop> {
        if let Some(seconds) = self.time {
            anyhow::ensure!(
                seconds > 0.0 && seconds <= 1e9,
                "--time is {seconds}, expected a number of seconds above 0 and up to 1e9"
            );
        }
        if let Some(percent) = self.target_error {
            anyhow::ensure!(
                percent > 0.0 && percent < 100.0,
                "--target-error is {percent}, expected a percentage between 0 and 100"
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
