//! The open limb: its decisions, its files, and the data that its images share.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use ppa_generate::{Case, LoadedScan};

use crate::case_file::CaseFile;
use crate::coarse_scan::CoarseScan;
use crate::desk::{Desk, Shown};
use crate::error::StudioError;
use crate::pose_label::Labels;
use crate::scene::Scenes;

/// The open limb.
pub(crate) struct Limb {
    pub scenes: Scenes,
    pub coarse: CoarseScan,
    pub labels: Labels,
    /// Front of the mortise, `ct` frame; known for the built-in phantom only.
    pub mortise: Option<[f64; 3]>,
    desk: Mutex<Desk>,
    case_file: Mutex<CaseFile>,
}

impl Limb {
    /// Opens a case and restores the changes saved next to its file, which need not exist yet.
    pub fn open(file: PathBuf, case: Case) -> Result<Self, StudioError> {
        let case_file = CaseFile::new(file);
        let case = if case_file.has_edits() {
            Case::read(case_file.edited())?
        } else {
            case
        };
        let desk = Desk::new(LoadedScan::of_case(&case)?, case)?;
        let coarse = CoarseScan::new(&desk.shown().prepared().volume)?;
        Ok(Self {
            scenes: Scenes::default(),
            coarse,
            labels: Labels::default(),
            mortise: None,
            desk: Mutex::new(desk),
            case_file: Mutex::new(case_file),
        })
    }

    pub fn shown(&self) -> Arc<Shown> {
        self.desk().shown()
    }

    pub fn desk(&self) -> MutexGuard<'_, Desk> {
        self.desk.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub fn case_file(&self) -> MutexGuard<'_, CaseFile> {
        self.case_file
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
    }

    /// Changes the displayed limb and saves it next to the case. A change that cannot be saved is not shown.
    pub fn edit(
        &self,
        change: impl FnOnce(&mut Desk) -> Result<(), StudioError>,
    ) -> Result<(), StudioError> {
        let mut desk = self.desk();
        let before = desk.clone();
        // These belong to the previous limb; the next one needs the memory.
        self.scenes.forget_limb();
        self.labels.forget_limb();
        change(&mut desk)?;
        let shown = desk.shown();
        if shown.revision == before.shown().revision {
            return Ok(());
        }
        let saved = self.case_file().save_edits(&shown.case);
        if saved.is_err() {
            *desk = before;
        }
        saved
    }

    /// Returns the path for a plan with changes, next to the case.
    pub fn saved_plan(&self) -> PathBuf {
        self.case_file().plan()
    }

    /// Returns the path for moved cameras, next to the case.
    pub fn saved_cameras(&self) -> PathBuf {
        self.case_file().cameras()
    }

    /// Returns the file that holds the displayed case.
    pub fn case_on_disk(&self) -> PathBuf {
        let file = self.case_file();
        let path: &Path = if file.has_edits() {
            file.edited()
        } else {
            file.original()
        };
        path.to_owned()
    }
}
