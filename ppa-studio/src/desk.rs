//! The limb as it is shown now, and the decisions that can be undone.

use std::sync::Arc;

use ppa_generate::{Case, Found, LoadedScan, PreparedLimb, VisibleLimb};
use ppa_mesh::Limb;
use ppa_scene::{LandmarkOverrides, Landmarks};

use crate::error::StudioError;

/// A limb with the decisions that led to it.
pub(crate) struct Shown {
    /// Counts changes; a later state has a higher number.
    pub revision: u64,
    pub case: Case,
    pub limb: VisibleLimb,
    /// What is found where nobody chooses anything.
    pub automatic: Option<Landmarks>,
}

impl Shown {
    pub fn prepared(&self) -> &Arc<PreparedLimb> {
        self.limb.prepared()
    }
}

/// The limb that is shown, and the cases before and after it.
#[derive(Clone)]
pub(crate) struct Desk {
    scan: Arc<LoadedScan>,
    shown: Arc<Shown>,
    earlier: Vec<Case>,
    later: Vec<Case>,
}

impl Desk {
    pub fn new(scan: LoadedScan, case: Case) -> Result<Self, StudioError> {
        let shown = Arc::new(shown(&scan, case, 1, None, None)?);
        Ok(Self {
            scan: Arc::new(scan),
            shown,
            earlier: Vec::new(),
            later: Vec::new(),
        })
    }

    pub fn shown(&self) -> Arc<Shown> {
        self.shown.clone()
    }

    /// Changes the decisions. If nothing is found with them, everything stays as it was.
    pub fn change(&mut self, case: Case) -> Result<(), StudioError> {
        if case == self.shown.case {
            return Ok(());
        }
        let before = self.show(case)?;
        self.earlier.push(before);
        self.later.clear();
        Ok(())
    }

    /// Keeps the body around a point as a part of the limb, or removes it if it is kept.
    ///
    /// # Errors
    /// [`StudioError::Prepare`] for a point in air or in the limb itself.
    pub fn keep_or_remove(&mut self, point: [f64; 3]) -> Result<(), StudioError> {
        let mut case = self.shown.case.clone();
        let (limb, kept) = self.scan.toggle_body(case.side, &case.surface, point)?;
        case.surface.kept = kept;
        let before = self.show_limb(case, Some(Arc::new(limb)))?;
        self.earlier.push(before);
        self.later.clear();
        Ok(())
    }

    pub fn undo(&mut self) -> Result<(), StudioError> {
        let Some(case) = self.earlier.last().cloned() else {
            return Ok(());
        };
        let before = self.show(case)?;
        self.earlier.pop();
        self.later.push(before);
        Ok(())
    }

    pub fn redo(&mut self) -> Result<(), StudioError> {
        let Some(case) = self.later.last().cloned() else {
            return Ok(());
        };
        let before = self.show(case)?;
        self.later.pop();
        self.earlier.push(before);
        Ok(())
    }

    /// Whether there is something to undo, and to redo.
    pub fn can_step(&self) -> [bool; 2] {
        [!self.earlier.is_empty(), !self.later.is_empty()]
    }

    /// Shows the limb of a case, and returns the case before.
    fn show(&mut self, case: Case) -> Result<Case, StudioError> {
        self.show_limb(case, None)
    }

    /// As [`Self::show`], with the limb that was extracted for the case.
    fn show_limb(&mut self, case: Case, limb: Option<Arc<Limb>>) -> Result<Case, StudioError> {
        let revision = self.shown.revision + 1;
        let next = shown(&self.scan, case, revision, Some(&self.shown), limb)?;
        let before = std::mem::replace(&mut self.shown, Arc::new(next));
        Ok(before.case.clone())
    }
}

fn shown(
    scan: &LoadedScan,
    case: Case,
    revision: u64,
    before: Option<&Shown>,
    extracted: Option<Arc<Limb>>,
) -> Result<Shown, StudioError> {
    let same_skin =
        |shown: &&Shown| shown.case.side == case.side && shown.case.surface == case.surface;
    let kept = before.filter(same_skin);
    let limb = extracted.or_else(|| kept.map(|shown| shown.prepared().limb.clone()));
    let prepared = match limb {
        Some(limb) => scan.find_landmarks_again(&case, limb)?,
        None => scan.prepare(&case)?,
    };
    let automatic = match kept {
        Some(shown) if shown.case.choices.limb == case.choices.limb => shown.automatic.clone(),
        _ => automatic(scan, &case, &prepared),
    };
    let found = Some(Found::of(&prepared));
    Ok(Shown {
        revision,
        case: Case { found, ..case },
        limb: VisibleLimb::new(prepared)?,
        automatic,
    })
}

/// What is found of a limb of this kind where nobody chooses; nothing where that is not possible.
fn automatic(scan: &LoadedScan, case: &Case, prepared: &PreparedLimb) -> Option<Landmarks> {
    let choices = LandmarkOverrides {
        limb: case.choices.limb,
        ..LandmarkOverrides::default()
    };
    if case.choices == choices {
        return Some(prepared.landmarks.clone());
    }
    let untouched = Case {
        choices,
        ..case.clone()
    };
    let found = scan.find_landmarks_again(&untouched, prepared.limb.clone());
    found.ok().map(|prepared| prepared.landmarks)
}
