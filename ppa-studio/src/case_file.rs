//! The files of the case: the original, and the changes saved next to it.

use std::path::{Path, PathBuf};

use ppa_generate::{Case, beside_case, edited_case};

use crate::error::StudioError;

/// Where a case stands, and where its changes are saved as they are made.
pub(crate) struct CaseFile {
    original: PathBuf,
    edited: PathBuf,
    /// The edited file as this program knows it; `None` while there is none.
    known: Option<String>,
}

impl CaseFile {
    /// `leg.case.toml`, whose changes go to `leg.edited.case.toml`.
    pub fn new(original: PathBuf) -> Self {
        let edited = edited_case(&original);
        let known = std::fs::read_to_string(&edited).ok();
        Self {
            original,
            edited,
            known,
        }
    }

    pub fn original(&self) -> &Path {
        &self.original
    }

    pub fn edited(&self) -> &Path {
        &self.edited
    }

    /// Where a plan with the page's changes is saved: beside the original.
    pub fn plan(&self) -> PathBuf {
        beside_case(&self.original, "studio.plan.toml")
    }

    /// Where moved cameras are saved: beside the original.
    pub fn cameras(&self) -> PathBuf {
        beside_case(&self.original, "studio.rig.json")
    }

    /// Whether changes are saved beside the original.
    pub fn has_edits(&self) -> bool {
        self.known.is_some()
    }

    /// Saves a changed case beside the original, with the comments that either has.
    ///
    /// # Errors
    /// [`StudioError::ChangedElsewhere`] if the file is no longer the one that was saved last.
    pub fn save_edits(&mut self, case: &Case) -> Result<(), StudioError> {
        if std::fs::read_to_string(&self.edited).ok() != self.known {
            return Err(StudioError::ChangedElsewhere(self.edited.clone()));
        }
        let earlier = match &self.known {
            Some(text) => Some(text.clone()),
            None => std::fs::read_to_string(&self.original).ok(),
        };
        match earlier {
            Some(text) => case.write_edited(&text, &self.edited)?,
            None => case.write(&self.edited)?,
        }
        self.known = std::fs::read_to_string(&self.edited).ok();
        Ok(())
    }

    /// Writes the case over the original, which the person has asked for, and removes the changes beside it.
    pub fn save(&mut self, case: &Case) -> Result<(), StudioError> {
        match std::fs::read_to_string(&self.original) {
            Ok(text) => case.write_edited(&text, &self.original)?,
            Err(_) => case.write(&self.original)?,
        }
        if self.has_edits() && std::fs::read_to_string(&self.edited).ok() == self.known {
            // The original holds all of it now; a file that cannot be removed is shown as changes again.
            let _ = std::fs::remove_file(&self.edited);
        }
        self.known = None;
        Ok(())
    }
}

/// Where the plan of a dataset with a case is saved, if none was opened.
pub(crate) fn new_plan(case: &Path) -> PathBuf {
    beside_case(case, "plan.toml")
}
