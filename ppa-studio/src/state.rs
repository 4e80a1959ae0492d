//! All state of a running studio.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use ppa_generate::{Case, LoadedScan, Plan, PlanCase};

use crate::case_file::CaseFile;
use crate::coarse_scan::CoarseScan;
use crate::desk::{Desk, Shown};
use crate::error::StudioError;
use crate::newest::Newest;
use crate::opening::Opening;
use crate::pose_label::Labels;
use crate::scene::Scenes;
use crate::token::Token;
use crate::what_if::WhatIf;

/// The limb that is shown, its files, and the work under way.
pub(crate) struct State {
    pub token: Token,
    pub plan: Plan,
    pub plan_file: Option<PathBuf>,
    pub scenes: Scenes,
    /// Depth images under way.
    pub depth: Newest,
    /// The radiograph under way.
    pub radiograph: Newest,
    pub coarse: CoarseScan,
    /// The surface of the coarse scan under way.
    pub surface: Newest,
    pub labels: Labels,
    /// The label under way.
    pub label: Newest,
    desk: Mutex<Desk>,
    case_file: Mutex<CaseFile>,
}

impl State {
    /// Opens a scan, a case or a plan, and takes up the changes that were saved beside the case.
    pub fn open(opening: &Opening) -> Result<Self, StudioError> {
        let opened = opening.read()?;
        let case_file = CaseFile::new(opened.case_file);
        let case = if case_file.has_edits() {
            Case::read(case_file.edited())?
        } else {
            opened.case
        };
        let desk = Desk::new(LoadedScan::of_case(&case)?, case)?;
        Ok(Self {
            token: Token::random()?,
            plan: opened.plan,
            plan_file: opened.plan_file,
            scenes: Scenes::default(),
            depth: Newest::default(),
            radiograph: Newest::default(),
            coarse: CoarseScan::default(),
            surface: Newest::default(),
            labels: Labels::default(),
            label: Newest::default(),
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

    /// Changes what is shown and saves it beside the case.
    pub fn edit(
        &self,
        change: impl FnOnce(&mut Desk) -> Result<(), StudioError>,
    ) -> Result<(), StudioError> {
        self.depth.cancel();
        self.radiograph.cancel();
        let mut desk = self.desk();
        let before = desk.shown().revision;
        change(&mut desk)?;
        let shown = desk.shown();
        if shown.revision != before {
            self.case_file().save_edits(&shown.case)?;
        }
        Ok(())
    }

    /// Where a plan with changes is saved: beside the case.
    pub fn saved_plan(&self) -> PathBuf {
        self.case_file().plan()
    }

    /// The plan with changes, of the case that is shown.
    pub fn plan_with(&self, what_if: &WhatIf) -> Result<Plan, StudioError> {
        let mut plan = what_if.plan(&self.plan)?;
        if plan.cases.is_empty() {
            plan.cases.push(PlanCase {
                file: self.case_on_disk(),
                patient: 0,
            });
        }
        Ok(plan)
    }

    /// The file that holds the case as it is shown.
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
