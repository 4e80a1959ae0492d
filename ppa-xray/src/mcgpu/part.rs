//! Parts of a scan: each follows its share of the histories of every projection and writes a tally for each.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use ppa_core::Part;

use crate::dose::report::Dose;
use crate::image::radiograph::Radiograph;
use crate::mcgpu::scan_error::ScanError;
use crate::mcgpu::sections::RunLength;
use crate::mcgpu::simulation::Simulation;
use crate::mcgpu::trajectory::Station;
use crate::run::analog_tally::AnalogTally;
use crate::run::progress::{Progress, Stop, Stopped};

/// A part of the histories of each projection of a scan.
#[derive(Debug, Clone, Copy)]
pub struct ScanPart<'a> {
    /// Histories of each projection, in all parts together.
    pub histories: u64,
    /// The part to follow.
    pub part: Part,
    /// Folder of its tallies.
    pub folder: &'a Path,
    /// Whether a tally that cannot be continued is replaced.
    pub replace: bool,
}

impl Simulation {
    /// Number of bytes of the tallies that a part still has to write.
    ///
    /// # Errors
    /// [`ScanError`] if the exposure is invalid.
    pub fn missing_part_bytes(&self, scan_part: &ScanPart) -> Result<u64, ScanError> {
        let stations = self.input().stations();
        let is_missing = |station: &&Station| !Self::part_tally(scan_part.folder, station).exists();
        let missing: Vec<_> = stations.iter().filter(is_missing).collect();
        let Some(station) = missing.first() else {
            return Ok(0);
        };
        let projection = self.projection(station);
        let length = RunLength::Histories(scan_part.histories);
        let run = self.analog_run(station, &projection, length)?;
        Ok(run.tally(scan_part.part).file_bytes() * missing.len() as u64)
    }

    /// Path of the tally of a projection in the folder of a part.
    pub fn part_tally(folder: &Path, station: &Station) -> PathBuf {
        folder.join(format!("projection_{:04}.tally", station.number))
    }

    /// Follows the histories of a part of a projection, and counts the requested doses, into [`Self::part_tally`] of the folder. An
    /// existing tally is continued; it is written every `save_every`, at the end, and when `observe` ends the run by
    /// [`ControlFlow::Break`].
    ///
    /// Returns whether all histories of the part have been followed.
    ///
    /// # Errors
    /// [`ScanError`] if the exposure is invalid, or if the tally cannot be read or written or belongs to another scan or part.
    pub fn follow_part(
        &self,
        station: &Station,
        scan_part: &ScanPart,
        save_every: Duration,
        mut observe: impl FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<bool, ScanError> {
        let &ScanPart {
            histories,
            part,
            folder,
            replace,
        } = scan_part;
        let path = Self::part_tally(folder, station);
        let projection = self.projection(station);
        let run = self.analog_run(station, &projection, RunLength::Histories(histories))?;
        let mut tally = match path.exists().then(|| run.read(&path, part)) {
            None => run.tally(part),
            Some(Err(_)) if replace => run.tally(part),
            Some(read) => read?,
        };
        if tally.done() == tally.part() && path.exists() {
            return Ok(true);
        }
        let mut saved = Instant::now();
        let mut failed = None;
        let ended = run.follow(&mut tally, &Stop::default(), |tally, progress| {
            if saved.elapsed() > save_every {
                saved = Instant::now();
                if let Err(error) = tally.write(&path) {
                    failed = Some(error);
                    return ControlFlow::Break(());
                }
            }
            observe(progress)
        })?;
        if let Some(error) = failed {
            return Err(error.into());
        }
        tally.write(&path)?;
        Ok(ended == Stopped::Complete)
    }

    /// Merges a projection of `histories` histories from the folders of all its parts, in any order.
    ///
    /// # Errors
    /// [`ScanError`] if a tally is missing, damaged, unfinished or of another scan, or if parts overlap or leave a gap.
    pub fn merge_parts(
        &self,
        station: &Station,
        histories: u64,
        folders: &[impl AsRef<Path>],
    ) -> Result<(Radiograph, Option<Dose>), ScanError> {
        let tallies = folders
            .iter()
            .map(|folder| Self::part_tally(folder.as_ref(), station));
        let tallies: Vec<PathBuf> = tallies.collect();
        let merged = AnalogTally::merge(&tallies)?;
        let projection = self.projection(station);
        let run = self.analog_run(station, &projection, RunLength::Histories(histories))?;
        run.check_whole(&merged, &tallies[0])?;
        Ok((merged.radiograph(), merged.dose()))
    }
}
