//! The files of the case: the original, and the changes beside it.

use std::path::{Path, PathBuf};

use ppa_generate::Case;

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
        beside(&self.original, "studio.plan.toml")
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
    beside(case, "plan.toml")
}

/// Where the changes of a case are saved.
pub(crate) fn edited_case(original: &Path) -> PathBuf {
    beside(original, "edited.case.toml")
}

/// The case that a file with changes belongs to; `None` for any other file.
pub(crate) fn original_case(edited: &Path) -> Option<PathBuf> {
    let name = edited.file_name()?.to_str()?;
    let stem = name.strip_suffix(".edited.case.toml")?;
    Some(edited.with_file_name(format!("{stem}.case.toml")))
}

/// A file beside a case, named after it: `leg.case.toml` and `edited.case.toml` give `leg.edited.case.toml`.
fn beside(case: &Path, ending: &str) -> PathBuf {
    let name = case.file_name().unwrap_or_default().to_string_lossy();
    let stem = name.strip_suffix(".toml").unwrap_or(&name);
    let stem = stem.strip_suffix(".case").unwrap_or(stem);
    case.with_file_name(format!("{stem}.{ending}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn changes_are_named_after_the_case() {
        let edited = |name: &str| beside(Path::new(name), "edited.case.toml");
        assert_eq!(
            edited("a/leg.case.toml"),
            Path::new("a/leg.edited.case.toml")
        );
        assert_eq!(edited("leg.toml"), Path::new("leg.edited.case.toml"));
    }
}
