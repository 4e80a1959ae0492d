//! The files that describe a dataset as a whole, kept up to date while its poses change: `dataset.json`, part and lists.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::sync::Mutex;

use ppa_core::Part;
use ppa_dataset::checksums::{Checksums, FoundChecksums};
use ppa_dataset::files::{FileError, remove_if_there};
use ppa_dataset::findings::Findings;
use ppa_dataset::manifest::DESCRIPTION_FILE;
use ppa_dataset::manifest::Manifest;

use crate::limb_jobs::LimbJobs;
use crate::lists::{Lists, stands};
use crate::part_file::{PART_FILE, part_text, read_part};
use crate::planned::Planned;
use crate::staging::Staging;

/// The files of one dataset that describe all its poses.
pub(crate) struct Overview<'a> {
    pub root: &'a Path,
    /// `dataset.json` of the run.
    pub description: &'a str,
    pub part: Part,
    pub staging: &'a Staging<'a>,
    is_open: Mutex<bool>,
    healed: Mutex<Vec<String>>,
}

impl<'a> Overview<'a> {
    pub fn new(root: &'a Path, description: &'a str, part: Part, staging: &'a Staging<'a>) -> Self {
        Self {
            root,
            description,
            part,
            staging,
            is_open: Mutex::default(),
            healed: Mutex::default(),
        }
    }

    /// Removes the lists, which would name images that are gone, and describes the run; called before poses change.
    pub fn open(&self, limbs: &[LimbJobs]) -> Result<(), FileError> {
        let mut is_open = self.is_open.lock().unwrap_or_else(|e| e.into_inner());
        if *is_open {
            return Ok(());
        }
        let covered = Checksums::look(self.root)?;
        let mut files: BTreeSet<_> = covered.files().map(str::to_owned).collect();
        files.extend(limbs.iter().map(|limb| limb.limb.roi_file()));
        files.insert(Findings::FILE.to_owned());
        files.remove(DESCRIPTION_FILE);
        files.remove(Manifest::FILE);
        // Without the manifest the dataset is unfinished, so it is removed first, and the hashes of the rest last.
        self.retire(Manifest::FILE, &covered)?;
        for file in &files {
            self.retire(file, &covered)?;
        }
        self.retire_checksums(&covered)?;
        self.describe()?;
        *is_open = true;
        Ok(())
    }

    /// Writes the intended content of the folder, so that its state is known from then on.
    pub fn describe(&self) -> Result<(), FileError> {
        let part = part_text(self.part);
        self.renew(PART_FILE, part.as_deref(), || read_part(self.root).is_ok())?;
        let is_whole = || Planned::read(self.root).is_ok();
        self.renew(DESCRIPTION_FILE, Some(self.description), is_whole)
    }

    /// Updates a file to the given text; a damaged one is set aside.
    fn renew(
        &self,
        file: &str,
        text: Option<&str>,
        is_whole: impl Fn() -> bool,
    ) -> Result<(), FileError> {
        let path = self.root.join(file);
        let found = match path.exists() {
            true => Some(fs::read(&path).map_err(FileError::at("read", &path))?),
            false => None,
        };
        if found.as_deref() == text.map(str::as_bytes) {
            return Ok(());
        }
        if found.is_some() && !is_whole() {
            self.staging.aside.keep(file)?;
            self.add_healed([file.to_owned()]);
        }
        match text {
            Some(text) => self.staging.write(file, text),
            None => remove_if_there(&path),
        }
    }

    /// Updates the lists to the current records.
    pub fn close(&self, lists: &Lists) -> Result<(), FileError> {
        let differing: Vec<_> = lists
            .files
            .iter()
            .filter(|list| !stands(self.root, list))
            .collect();
        let covered = Checksums::look(self.root)?;
        let earlier = covered.files().chain([Findings::FILE]);
        let gone = |file: &&str| *file != DESCRIPTION_FILE && !lists.holds(file);
        for file in earlier.filter(gone) {
            self.retire(file, &covered)?;
        }
        // The manifest is removed first and written last.
        for (file, _) in differing.iter().rev() {
            match file.as_str() {
                Checksums::FILE => self.retire_checksums(&covered)?,
                file => self.retire(file, &covered)?,
            }
        }
        self.describe()?;
        for (file, text) in differing {
            self.staging.write(file, text)?;
        }
        Ok(())
    }

    fn retire(&self, file: &str, covered: &FoundChecksums) -> Result<(), FileError> {
        if self.staging.retire(file, covered.hash_of(file))? {
            self.add_healed([file.to_owned()]);
        }
        self.staging.remove_empty_folders(file);
        Ok(())
    }

    fn retire_checksums(&self, covered: &FoundChecksums) -> Result<(), FileError> {
        match covered {
            FoundChecksums::Absent => Ok(()),
            FoundChecksums::Whole(_) => remove_if_there(&self.root.join(Checksums::FILE)),
            FoundChecksums::Damaged => {
                self.add_healed([Checksums::FILE.to_owned()]);
                self.staging.aside.keep(Checksums::FILE)
            }
        }
    }

    /// Records files that are made again because they were missing or altered.
    pub fn add_healed(&self, files: impl IntoIterator<Item = String>) {
        let mut healed = self.healed.lock().unwrap_or_else(|e| e.into_inner());
        healed.extend(files);
    }

    /// All files that are made again, sorted.
    pub fn into_healed(self) -> Vec<String> {
        let mut healed = self.healed.into_inner().unwrap_or_else(|e| e.into_inner());
        healed.sort();
        healed
    }
}
