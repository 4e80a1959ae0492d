//! The displayed limb and the undo history of its decisions.

use std::sync::Arc;

use ppa_generate::{Case, Found, LoadedScan, PreparedLimb, VisibleLimb};
use ppa_mesh::Limb;
use ppa_scene::{LandmarkOverrides, Landmarks};

use crate::error::StudioError;

/// A limb with the decisions that led to it.
pub(crate) struct Shown {
    /// Number of the state; later states have higher numbers.
    pub revision: u64,
    pub case: Case,
    pub limb: VisibleLimb,
    /// Landmarks found without manual choices.
    pub automatic: Option<Landmarks>,
}

impl Shown {
    pub fn prepared(&self) -> &Arc<PreparedLimb> {
        self.limb.prepared()
    }
}

/// The displayed limb, and the earlier and later cases for undo and redo.
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

    /// Changes the decisions. If the limb cannot be prepared with them, nothing changes.
    pub fn change(&mut self, case: Case) -> Result<(), StudioError> {
        if case == self.shown.case {
            return Ok(());
        }
        let before = self.show(case)?;
        self.earlier.push(before);
        self.later.clear();
        Ok(())
    }

    /// Keeps the body around a point as part of the limb, or removes it if it was kept.
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

    /// Whether undo and redo are possible, in this order.
    pub fn can_step(&self) -> [bool; 2] {
        [!self.earlier.is_empty(), !self.later.is_empty()]
    }

    /// Shows the limb of a case and returns the previous case.
    fn show(&mut self, case: Case) -> Result<Case, StudioError> {
        self.show_limb(case, None)
    }

    /// The same as [`Self::show`], with a limb already extracted for the case.
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

/// Returns the landmarks found for a limb of this kind without manual choices; `None` if they are not found.
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
