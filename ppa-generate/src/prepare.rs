//! From a CT to a case: every decision is proposed automatically and can be changed.

use std::path::Path;
use std::sync::Arc;

use ppa_ct::{ReadOptions, Scan};
use ppa_mesh::LimbSettings;
use ppa_scene::{LandmarkOverrides, Side};

use crate::case::{Case, Found, Source};
use crate::loaded_scan::LoadedScan;
use crate::prepared_limb::{PrepareError, PreparedLimb};

/// Proposes a case for one limb of the scan at `path`, read with the options `reading`.
///
/// Given `surface` and `choices` are kept; the rest is found. Of two limbs side by side the one on `side` of the patient is selected, with
/// a warning; a warning is also given if the image shows too little of that limb.
///
/// # Errors
/// [`PrepareError`] when the scan is unreadable, holds no limb, or shows no landmarks.
pub fn prepare(
    path: &Path,
    reading: &ReadOptions,
    side: Side,
    surface: &LimbSettings,
    choices: &LandmarkOverrides,
) -> Result<(Case, PreparedLimb), PrepareError> {
    prepare_scan(
        ppa_ct::read_with(path, reading)?,
        path,
        reading,
        side,
        surface,
        choices,
    )
}

/// Like [`prepare`], with a scan that was read from `path` with `reading`.
///
/// # Errors
/// The same as [`prepare`].
pub fn prepare_scan(
    scan: Scan,
    path: &Path,
    reading: &ReadOptions,
    side: Side,
    surface: &LimbSettings,
    choices: &LandmarkOverrides,
) -> Result<(Case, PreparedLimb), PrepareError> {
    let series = match reading.series {
        None => None,
        Some(_) => Some(
            number_of_its_own(&scan)
                .ok_or_else(|| PrepareError::SeriesWithoutNumber(path.to_owned()))?,
        ),
    };
    let volume_sha256 = scan.volume.sha256();
    let scan = LoadedScan::from(scan);
    let limb = Arc::new(scan.extract(side, surface)?);
    let prepared = scan.with_landmarks(limb, side, surface, choices)?;
    let case = Case {
        version: 1,
        side,
        acknowledged: Vec::new(),
        source: Source {
            path: path.to_owned(),
            volume_sha256,
            series,
            fill_gaps: reading.fill_gaps,
            force: reading.force,
        },
        surface: surface.clone(),
        choices: choices.clone(),
        bones: None,
        found: Some(Found::of(&prepared)),
    };
    Ok((case, prepared))
}

/// Number of the series that was read; `None` if it has none or shares it. Its UID stays out of the case.
fn number_of_its_own(scan: &Scan) -> Option<i32> {
    let number = scan.series.iter().find(|series| series.read)?.number?;
    let sharing = scan.series.iter().filter(|s| s.number == Some(number));
    (sharing.count() == 1).then_some(number)
}
