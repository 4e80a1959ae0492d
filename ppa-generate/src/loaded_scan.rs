//! A scan that is kept in memory while the decisions of its case change.

use std::sync::Arc;

use ppa_ct::{Scan, Volume, Warning};
use ppa_mesh::{Limb, LimbSettings, extract_limb, toggle_body};
use ppa_scene::{LandmarkOverrides, Side};

use crate::case::{Case, Found};
use crate::gates::require_limb;
use crate::prepared_limb::{PrepareError, PreparedLimb, towards_left};

/// The scan of a case, from which its limb is prepared again whenever decisions change.
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

    /// Takes a scan that was read with the options of a case.
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

    /// Prepares the limb of a case.
    ///
    /// # Errors
    /// [`PrepareError`] when the scan holds no limb or shows no landmarks.
    pub fn prepare(&self, case: &Case) -> Result<PreparedLimb, PrepareError> {
        let limb = self.extract(case.side, &case.surface)?;
        self.with_landmarks(Arc::new(limb), case.side, &case.surface, &case.choices)
    }

    /// Like [`Self::prepare`], but faster: reuses `limb`, which was extracted for another case with the same side and surface.
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

    /// Extracts the limb, without landmarks.
    ///
    /// # Errors
    /// [`PrepareError`] when the scan holds no limb.
    pub fn extract(&self, side: Side, surface: &LimbSettings) -> Result<Limb, PrepareError> {
        let limb = extract_limb(&self.volume, &on_side(side, surface))?;
        require_limb(&limb.report, self.volume.grid().spacing_mm().into())?;
        Ok(limb)
    }

    /// Like [`Self::extract`], with the body around `point` (`ct` frame, mm) added to the limb, or removed if it was added; also returns
    /// the points for [`LimbSettings::kept`].
    ///
    /// # Errors
    /// [`PrepareError`] when the scan holds no limb, or the point is in no other body.
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

/// Settings that select the limb on `side` by default.
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
    /// Results of the preparation of a limb.
    pub fn of(prepared: &PreparedLimb) -> Self {
        Self {
            findings: prepared.findings.clone(),
            landmarks: prepared.landmarks.clone(),
            surface: prepared.limb.report.clone(),
        }
    }
}

impl PreparedLimb {
    /// Prepares the limb of a case.
    ///
    /// # Errors
    /// [`PrepareError`]; a scan other than the one the case was made from is refused.
    pub fn of_case(case: &Case) -> Result<Self, PrepareError> {
        LoadedScan::of_case(case)?.prepare(case)
    }

    /// Like [`PreparedLimb::of_case`], with a scan that was read with the options of the case.
    ///
    /// # Errors
    /// The same as [`PreparedLimb::of_case`].
    pub fn of_scan(scan: Scan, case: &Case) -> Result<Self, PrepareError> {
        LoadedScan::of_scan(scan, case)?.prepare(case)
    }
}
