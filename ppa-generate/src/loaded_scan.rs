//! A scan that is kept in memory while the decisions of its case change.

use std::sync::Arc;

use ppa_ct::{Scan, Volume, Warning};
use ppa_mesh::{Limb, LimbSettings, extract_limb, toggle_body};
use ppa_scene::{LandmarkOverrides, Side};

use crate::case::{Case, Found};
use crate::gates::require_limb;
use crate::prepared_limb::{PrepareError, PreparedLimb, towards_left};

/// The scan of a case, from which its limb is prepared as often as decisions change.
pub struct LoadedScan {
    /// Hounsfield units in the `ct` frame.
    pub volume: Volume,
    warnings: Vec<Warning>,
}

impl LoadedScan {
    /// Reads the scan of a case.
    ///
    /// # Errors
    /// [`PrepareError`] for a scan that cannot be read or is not the one the case was made from.
    pub fn of_case(case: &Case) -> Result<Self, PrepareError> {
        let scan = ppa_ct::read_with(&case.source.path, &case.source.reading())?;
        Self::of_scan(scan, case)
    }

    /// Takes a scan that was read as a case says.
    ///
    /// # Errors
    /// [`PrepareError::OtherScan`] when it is not the one the case was made from.
    pub fn of_scan(scan: Scan, case: &Case) -> Result<Self, PrepareError> {
        let found = scan.volume.sha256();
        if found != case.source.volume_sha256 {
            return Err(PrepareError::OtherScan {
                path: case.source.path.clone(),
                found,
                expected: case.source.volume_sha256.clone(),
            });
        }
        Ok(scan.into())
    }

    /// Carries out the decisions of a case.
    ///
    /// # Errors
    /// [`PrepareError`] when the scan holds no limb or shows no landmarks.
    pub fn prepare(&self, case: &Case) -> Result<PreparedLimb, PrepareError> {
        let limb = self.extract(case.side, &case.surface)?;
        self.with_landmarks(Arc::new(limb), case.side, &case.surface, &case.choices)
    }

    /// As [`Self::prepare`], faster: `limb` was extracted for another case with the same side and surface, and is kept.
    ///
    /// # Errors
    /// [`PrepareError`] when its landmarks are not found.
    pub fn find_landmarks_again(
        &self,
        case: &Case,
        limb: Arc<Limb>,
    ) -> Result<PreparedLimb, PrepareError> {
        self.with_landmarks(limb, case.side, &case.surface, &case.choices)
    }

    /// The limb alone, without landmarks.
    ///
    /// # Errors
    /// [`PrepareError`] when the scan holds no limb.
    pub fn extract(&self, side: Side, surface: &LimbSettings) -> Result<Limb, PrepareError> {
        let limb = extract_limb(&self.volume, &on_side(side, surface))?;
        require_limb(&limb.report, self.volume.grid().spacing_mm().into())?;
        Ok(limb)
    }

    /// As [`Self::extract`], with the body around `point` (`ct` frame, mm) kept as a part of the limb, or removed if it is kept; and the
    /// points of [`LimbSettings::kept`] that say so.
    ///
    /// # Errors
    /// [`PrepareError`] when the scan holds no limb, or the point is in no body beside it.
    pub fn toggle_body(
        &self,
        side: Side,
        surface: &LimbSettings,
        point: [f64; 3],
    ) -> Result<(Limb, Vec<[f64; 3]>), PrepareError> {
        let (limb, kept) = toggle_body(&self.volume, &on_side(side, surface), point)?;
        require_limb(&limb.report, self.volume.grid().spacing_mm().into())?;
        Ok((limb, kept))
    }

    pub(crate) fn with_landmarks(
        &self,
        limb: Arc<Limb>,
        side: Side,
        surface: &LimbSettings,
        choices: &LandmarkOverrides,
    ) -> Result<PreparedLimb, PrepareError> {
        PreparedLimb::new(
            self.volume.clone(),
            limb,
            &self.warnings,
            side,
            surface,
            choices,
        )
    }
}

/// Settings that take the limb of that side where nothing else is wanted.
fn on_side(side: Side, surface: &LimbSettings) -> LimbSettings {
    LimbSettings {
        towards: surface.towards.or(Some([towards_left(side), 0.0, 0.0])),
        ..surface.clone()
    }
}

impl From<Scan> for LoadedScan {
    fn from(scan: Scan) -> Self {
        Self {
            volume: scan.volume,
            warnings: scan.warnings,
        }
    }
}

impl Found {
    /// What was found of a limb.
    pub fn of(prepared: &PreparedLimb) -> Self {
        Self {
            findings: prepared.findings.clone(),
            landmarks: prepared.landmarks.clone(),
            surface: prepared.limb.report.clone(),
        }
    }
}

impl PreparedLimb {
    /// Carries out the decisions of a case.
    ///
    /// # Errors
    /// [`PrepareError`]; a scan other than the one the case was made from is refused.
    pub fn of_case(case: &Case) -> Result<Self, PrepareError> {
        LoadedScan::of_case(case)?.prepare(case)
    }

    /// As [`PreparedLimb::of_case`], of a scan that was read as the case says.
    ///
    /// # Errors
    /// As [`PreparedLimb::of_case`].
    pub fn of_scan(scan: Scan, case: &Case) -> Result<Self, PrepareError> {
        LoadedScan::of_scan(scan, case)?.prepare(case)
    }
}
