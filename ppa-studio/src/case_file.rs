//! The files of the case: the original, and the changes saved next to it.

use std::path::{Path, PathBuf};

use ppa_generate::{Case, beside_case, edited_case};

use crate::error::StudioError;

/// Paths of a case file and of the file for its changes, which are saved as they are made.
pub(crate) struct CaseFile {
    original: PathBuf,
    edited: PathBuf,
    /// Text of the edited file as last read or saved by this program; `None` if there is none.
    known: Option<String>,
}

impl CaseFile {
    /// Returns the files of a case. Changes of `leg.case.toml` go to `leg.edited.case.toml`.
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

    /// Returns the path for a plan with the page's changes, next to the original.
    pub fn plan(&self) -> PathBuf {
        beside_case(&self.original, "studio.plan.toml")
    }

    /// Returns the path for moved cameras, next to the original.
    pub fn cameras(&self) -> PathBuf {
        beside_case(&self.original, "studio.rig.json")
    }

    /// Whether changes are saved next to the original.
    pub fn has_edits(&self) -> bool {
        self.known.is_some()
    }

    /// Saves a changed case next to the original. Keeps the comments of the earlier edited file, or of the original.
    ///
    /// # Errors
    /// [`StudioError::ChangedElsewhere`] if the file has changed since it was last saved.
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

    /// Overwrites the original with the case, at the user's request, and removes the changes next to it.
    pub fn save(&mut self, case: &Case) -> Result<(), StudioError> {
        match std::fs::read_to_string(&self.original) {
            Ok(text) => case.write_edited(&text, &self.original)?,
            Err(_) => case.write(&self.original)?,
        }
        if self.has_edits() && std::fs::read_to_string(&self.edited).ok() == self.known {
            // The original holds all changes now; a file that cannot be removed is shown as changes again.
            let _ = std::fs::remove_file(&self.edited);
        }
        self.known = None;
        Ok(())
    }
}

/// Returns the path for the plan of a dataset with this case, used if no plan was opened.
pub(crate) fn new_plan(case: &Path) -> PathBuf {
    beside_case(case, "plan.toml")
}
