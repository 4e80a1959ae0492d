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
use ppa_xray::{AnalogRun, AnalogSettings, AnalogTally, Radiograph, Stop, TallyError};

use crate::exposable_limb::PosedExposure;
use crate::pose_error::PoseError;
use crate::pose_id::PoseId;
use crate::record::PoseJob;

/// Time between two saves of a tally: the most that a killed run loses of it.
const SAVE_EVERY: Duration = Duration::from_secs(60);

/// Folder of the tallies of poses in progress, and the flag that stops the run.
pub(crate) struct AnalogHistories<'a> {
    pub folder: PathBuf,
    pub stop: Option<&'a AtomicBool>,
}

impl AnalogHistories<'_> {
    /// Makes the radiograph of a pose, starting from the histories that an earlier run with the same settings and code has followed. A
    /// damaged tally is replaced.
    ///
    /// # Errors
    /// [`PoseError::Stopped`] once the run is asked to stop; the histories are kept. [`PoseError::Tally`] when they cannot be
    /// read or saved.
    pub fn radiograph(
        &self,
        pose_job: &PoseJob,
        exposure: &PosedExposure,
        settings: &AnalogSettings,
    ) -> Result<Radiograph, PoseError> {
        let limb = exposure.limb;
        let (phantom, spectrum) = (limb.phantom.phantom(), &limb.spectrum);
        let run = AnalogRun::new(phantom, spectrum, &exposure.projection, settings)?;
        // The key covers the code, which the tally itself does not state.
        let key = &pose_job.key()[..16];
        let path = self
            .folder
            .join(format!("{}{key}.tally", prefix(pose_job.id())));
        let mut tally = match run.read(&path, Part::WHOLE) {
            Ok(tally) => tally,
            Err(TallyError::Read { path, source }) if source.kind() != io::ErrorKind::NotFound => {
                return Err(TallyError::Read { path, source }.into());
            }
            Err(_) => run.tally(Part::WHOLE),
        };
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

    /// Removes the tallies of a pose that is in its place.
    pub fn remove(&self, pose: PoseId) -> Result<(), FileError> {
        let prefix = prefix(pose);
        let mut tallies = self.tallies().into_iter();
        tallies.try_for_each(|name| match name.starts_with(&prefix) {
            true => remove_if_there(&self.folder.join(name)),
            false => Ok(()),
        })
    }

    /// Removes the tallies of all poses, including those no longer planned, and the folder if it is then empty.
    pub fn remove_all(&self) {
        // The dataset is complete: a file that cannot be removed takes space, but does no harm.
        for name in self.tallies() {
            let _ = fs::remove_file(self.folder.join(name));
        }
        let _ = fs::remove_dir(&self.folder);
    }

    fn tallies(&self) -> Vec<String> {
        let entries = fs::read_dir(&self.folder).into_iter().flatten().flatten();
        let names = entries.map(|entry| entry.file_name().to_string_lossy().into_owned());
        names
            .filter(|name| name.starts_with("patient_") && name.ends_with(".tally"))
            .collect()
    }
}

/// Prefix of the file names of a pose's tallies.
fn prefix(pose: PoseId) -> String {
    format!("{}_", pose.limb.unit_name(pose.step))
}
