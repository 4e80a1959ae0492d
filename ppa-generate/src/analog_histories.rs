//! Histories of analog radiographs that a stopped run keeps, so that the next one resumes from them.
//!
//! A radiograph of 2e10 histories takes hours. Its tally is saved every minute and when the run is asked to stop, and removed
//! once the pose is in its place.

use std::fs;
use std::io;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use ppa_core::Part;
use ppa_dataset::files::{FileError, remove_if_there};
use ppa_dataset::stop::Stopped;
use ppa_xray::{AnalogRun, AnalogSettings, AnalogTally, Radiograph, Stop};

use crate::exposable_limb::PosedExposure;
use crate::pose_error::PoseError;
use crate::pose_id::PoseId;

/// Time between two saved states of a tally: at most what a killed run loses of it.
const SAVE_EVERY: Duration = Duration::from_secs(60);

/// Where a run keeps the tallies of the poses in progress, and what stops it.
pub(crate) struct AnalogHistories<'a> {
    pub folder: PathBuf,
    pub stop: Option<&'a AtomicBool>,
}

impl AnalogHistories<'_> {
    /// The radiograph of a pose, which begins with the histories that an earlier run has followed. A tally of other settings
    /// or a damaged one is replaced.
    ///
    /// # Errors
    /// [`PoseError::Stopped`] once the run is asked to stop; the histories are kept.
    pub fn radiograph(
        &self,
        pose: PoseId,
        exposure: &PosedExposure,
        settings: &AnalogSettings,
    ) -> Result<Radiograph, PoseError> {
        let limb = exposure.limb;
        let (phantom, spectrum) = (limb.phantom.phantom(), &limb.spectrum);
        let run = AnalogRun::new(phantom, spectrum, &exposure.projection, settings)?;
        let path = self.tally(pose);
        let earlier = run.read(&path, Part::WHOLE);
        let mut tally = earlier.unwrap_or_else(|_| run.tally(Part::WHOLE));
        let mut saved = Instant::now();
        let mut failed = None;
        let is_asked = || self.stop.is_some_and(|stop| stop.load(Ordering::Relaxed));
        let ended = run.follow(&mut tally, &Stop::default(), |tally, _| {
            if saved.elapsed() > SAVE_EVERY {
                saved = Instant::now();
                failed = self.save(tally, &path).err();
            }
            match failed.is_some() || is_asked() {
                true => ControlFlow::Break(()),
                false => ControlFlow::Continue(()),
            }
        })?;
        match (failed, ended) {
            (Some(error), _) => Err(error),
            (None, ppa_xray::Stopped::Complete) => Ok(tally.radiograph()),
            (None, _) => {
                self.save(&tally, &path)?;
                Err(Stopped.into())
            }
        }
    }

    fn save(&self, tally: &AnalogTally, path: &Path) -> Result<(), PoseError> {
        let folder = &self.folder;
        fs::create_dir_all(folder).map_err(FileError::at("create folder", folder))?;
        Ok(tally.write(path)?)
    }

    /// Removes the tally of a pose that is in its place.
    pub fn remove(&self, pose: PoseId) -> Result<(), FileError> {
        remove_if_there(&self.tally(pose))
    }

    /// Removes the folder if no pose is in progress.
    pub fn remove_if_empty(&self) -> Result<(), FileError> {
        match fs::remove_dir(&self.folder) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
            Err(error) if error.kind() == io::ErrorKind::DirectoryNotEmpty => Ok(()),
            removed => removed.map_err(FileError::at("remove", &self.folder)),
        }
    }

    fn tally(&self, pose: PoseId) -> PathBuf {
        let name = pose.limb.unit_name(pose.step);
        self.folder.join(format!("{name}.tally"))
    }
}
