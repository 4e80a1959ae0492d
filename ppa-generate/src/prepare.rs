//! From a CT to a case: every decision proposed automatically, every one open to change.

use std::path::{Path, PathBuf};

use ppa_ct::{ReadOptions, Scan, Volume, Warning, WarningCode};
use ppa_dataset::findings::{Finding, FindingCode, Severity};
use ppa_mesh::{Limb, LimbReport, LimbSettings, extract_limb};
use ppa_scene::{LandmarkOverrides, Landmarks, Side, find_landmarks};

use crate::case::{Case, Found, Source};
use crate::cut_findings::cuts;
use crate::gates::{self, NotALimb, require_limb};

/// Why a limb could not be prepared.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PrepareError {
    /// The scan cannot be read.
    #[error(transparent)]
    Read(#[from] ppa_ct::ReadError),
    /// A chosen series that a case cannot name: cases hold no UID.
    #[error("the chosen series in {} has no number of its own; put its files into a folder of their own", .0.display())]
    SeriesWithoutNumber(PathBuf),
    /// No limb was found in it.
    #[error(transparent)]
    Limb(#[from] ppa_mesh::LimbError),
    /// What was found is far too small for one.
    #[error(transparent)]
    NotALimb(#[from] NotALimb),
    /// Its landmarks were not found.
    #[error(transparent)]
    Landmarks(#[from] ppa_scene::LandmarkError),
    /// The scan is not the one the case was made from.
    #[error(
        "{} is not the scan this case was made from (volume hash {found}, expected {expected})",
        path.display()
    )]
    OtherScan {
        /// The scan.
        path: PathBuf,
        /// Its hash.
        found: String,
        /// The hash in the case.
        expected: String,
    },
}

/// One limb, ready to be placed: its scan, skin and landmarks, all in the ct frame.
pub struct PreparedLimb {
    /// The scan.
    pub volume: Volume,
    /// Skin and voxels of the limb.
    pub limb: Limb,
    /// Axis, joint and plane.
    pub landmarks: Landmarks,
    /// Doubts about scan and limb, severe ones first.
    pub findings: Vec<Finding>,
}

impl PreparedLimb {
    fn new(
        scan: Scan,
        side: Side,
        surface: &LimbSettings,
        choices: &LandmarkOverrides,
    ) -> Result<Self, PrepareError> {
        let Scan {
            volume, warnings, ..
        } = scan;
        let given = surface;
        let surface = LimbSettings {
            towards: surface.towards.or(Some([towards_left(side), 0.0, 0.0])),
            ..surface.clone()
        };
        let limb = extract_limb(&volume, &surface)?;
        require_limb(&limb.report, volume.grid().spacing_mm().into())?;
        let landmarks = find_landmarks(&volume, &limb.mesh, &limb.mask, side, choices)?;
        let mut findings: Vec<Finding> = warnings
            .into_iter()
            .map(of_warning)
            .chain(several_limbs(&limb.report))
            .chain(other_on_side(&limb.report, side, given))
            .chain(cuts(&limb.walls, &limb.mesh, &landmarks))
            .chain(gates::findings(&volume, &limb, &landmarks)?)
            .collect();
        findings.sort_by_key(|finding| std::cmp::Reverse(finding.severity));
        Ok(Self {
            volume,
            limb,
            landmarks,
            findings,
        })
    }

    /// Severe findings that are not acknowledged.
    pub fn open_findings(&self, acknowledged: &[FindingCode]) -> impl Iterator<Item = &Finding> {
        self.findings.iter().filter(|finding| {
            finding.severity == Severity::Severe && !acknowledged.contains(&finding.code)
        })
    }

    /// Carries out the decisions of a case.
    ///
    /// # Errors
    /// [`PrepareError`]; a scan other than the one the case was made from is refused.
    pub fn of_case(case: &Case) -> Result<Self, PrepareError> {
        let scan = ppa_ct::read_with(&case.source.path, &case.source.reading())?;
        let found = scan.volume.sha256();
        if found != case.source.volume_sha256 {
            return Err(PrepareError::OtherScan {
                path: case.source.path.clone(),
                found,
                expected: case.source.volume_sha256.clone(),
            });
        }
        Self::new(scan, case.side, &case.surface, &case.choices)
    }
}

/// Proposes a case for one limb of the scan at `path`, read with the options `reading`.
///
/// Given `surface` and `choices` are kept; what they leave open is found. Of two limbs side by side the one on
/// `side` of the patient is taken, and a warning says so; one says as well when the image shows too little of that one.
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
    let scan = ppa_ct::read_with(path, reading)?;
    let series = match reading.series {
        None => None,
        Some(_) => Some(
            number_of_its_own(&scan)
                .ok_or_else(|| PrepareError::SeriesWithoutNumber(path.to_owned()))?,
        ),
    };
    let volume_sha256 = scan.volume.sha256();
    let prepared = PreparedLimb::new(scan, side, surface, choices)?;
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
        found: Some(Found {
            findings: prepared.findings.clone(),
            landmarks: prepared.landmarks.clone(),
            surface: prepared.limb.report.clone(),
        }),
    };
    Ok((case, prepared))
}

/// A reader's warning as a finding.
fn of_warning(warning: Warning) -> Finding {
    let severity = match warning.code {
        WarningCode::LocalizersDropped
        | WarningCode::NonImagesDropped
        | WarningCode::PixelPadding => Severity::Note,
        WarningCode::NotHu | WarningCode::NotCt | WarningCode::SingleSlice => Severity::Severe,
        _ => Severity::Caution,
    };
    Finding {
        code: FindingCode::ScanWarning,
        severity,
        text: warning.text,
        value: None,
        place_mm: None,
    }
}

/// 1 for the left, -1 for the right: in LPS, x grows towards the patient's left.
fn towards_left(side: Side) -> f64 {
    match side {
        Side::Right => -1.0,
        Side::Left => 1.0,
    }
}

/// A body with bone that holds at least this much of the limb's solid volume may be the limb that was meant.
const LEAST_OF_LIMB: f64 = 0.1;

/// That beside the limb, on the side which was asked for, another one lies of which the scan shows too little to be
/// taken; nothing when a person said where the limb is.
fn other_on_side(report: &LimbReport, side: Side, settings: &LimbSettings) -> Option<Finding> {
    if settings.inside.is_some() || settings.towards.is_some() {
        return None;
    }
    let chosen = report.bodies.iter().find(|body| body.chosen)?;
    let beside = report.bodies.iter().find(|body| {
        let [x, y, z] = [0, 1, 2].map(|axis| body.centre_mm[axis] - chosen.centre_mm[axis]);
        // Within 60 degrees of the side, the same limit as for bodies side by side in the choice of the limb.
        let is_on_side = 2.0 * x * towards_left(side) >= x.hypot(y).hypot(z);
        let may_be_limb = body.bone_mm3 > 0.0 && body.core_mm3 >= LEAST_OF_LIMB * chosen.core_mm3;
        !body.chosen && !body.alike && is_on_side && may_be_limb
    })?;
    let (name, other) = match side {
        Side::Right => ("right", "left"),
        Side::Left => ("left", "right"),
    };
    let [x, y, z] = chosen.centre_mm.map(ppa_core::text::number);
    let millilitres = beside.core_mm3 * 1e-3;
    let text = format!(
        "the limb around {x:.0}, {y:.0}, {z:.0} mm was taken, but towards the patient's {name} lies another one, cut by the \
         image ({millilitres:.0} ml with little bone): is it the {other} limb that was taken? (--inside takes the other)"
    );
    Some(Finding {
        code: FindingCode::OtherLimbOnSide,
        severity: Severity::Severe,
        text,
        value: Some(beside.core_mm3),
        place_mm: Some(beside.centre_mm),
    })
}

/// Which of several limbs was taken.
fn several_limbs(report: &LimbReport) -> Option<Finding> {
    let alike = report.bodies.iter().filter(|body| body.alike).count();
    let chosen = report.bodies.iter().find(|body| body.chosen)?;
    let [x, y, z] = chosen.centre_mm.map(ppa_core::text::number);
    (alike > 1).then(|| Finding {
        code: FindingCode::SeveralLimbs,
        severity: Severity::Caution,
        text: format!(
            "the scan shows {alike} limbs; the one around {x:.0}, {y:.0}, {z:.0} mm was taken (--inside takes another)"
        ),
        value: Some(alike as f64),
        place_mm: Some(chosen.centre_mm),
    })
}

/// The number of the series that was read, unless it has none or shares it; its UID stays out of the case.
fn number_of_its_own(scan: &Scan) -> Option<i32> {
    let number = scan.series.iter().find(|series| series.read)?.number?;
    let sharing = scan.series.iter().filter(|s| s.number == Some(number));
    (sharing.count() == 1).then_some(number)
}

#[cfg(test)]
mod tests {
    use ppa_mesh::Body;

    use super::*;

    fn body(chosen: bool, core_mm3: f64, x: f64) -> Body {
        Body {
            chosen,
            alike: chosen,
            core_mm3,
            bone_mm3: 1e-2 * core_mm3,
            side_cut_mm2: 0.0,
            centre_mm: [x, 80.0, 400.0],
        }
    }

    #[test]
    fn a_cut_limb_on_the_wanted_side_is_reported() {
        let settings = LimbSettings::default();
        let with = |other: Body, side, settings: &LimbSettings| {
            let bodies = vec![body(true, 1.4e6, -67.0), other];
            let report = LimbReport {
                bodies,
                ..LimbReport::default()
            };
            other_on_side(&report, side, settings)
        };
        let finding = with(body(false, 4e5, 31.0), Side::Left, &settings).unwrap();
        assert!(
            finding.text.contains("patient's left") && finding.text.contains("-67, 80, 400"),
            "{finding:?}"
        );
        assert_eq!(with(body(false, 4e5, 31.0), Side::Right, &settings), None);
        assert_eq!(with(body(false, 1e5, 31.0), Side::Left, &settings), None);
        let without_bone = Body {
            bone_mm3: 0.0,
            ..body(false, 4e5, 31.0)
        };
        assert_eq!(with(without_bone, Side::Left, &settings), None);
        let pointed_at = LimbSettings {
            inside: Some([-67.0, 80.0, 400.0]),
            ..settings
        };
        assert_eq!(with(body(false, 4e5, 31.0), Side::Left, &pointed_at), None);
    }
}
