//! A limb with its landmarks and findings.

use std::path::PathBuf;
use std::sync::Arc;

use ppa_ct::{Volume, Warning, WarningCode};
use ppa_dataset::findings::{Finding, FindingCode, Severity};
use ppa_mesh::{Limb, LimbReport, LimbSettings};
use ppa_scene::{LandmarkOverrides, Landmarks, Side, find_landmarks};

use crate::cut_findings::cuts;
use crate::gates::{self, NotALimb};

/// Why a limb could not be prepared.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PrepareError {
    /// The scan cannot be read.
    #[error(transparent)]
    Read(#[from] ppa_ct::ReadError),
    /// The chosen series cannot be named in a case, which holds no UID.
    #[error("the chosen series in {} has no unique number; put its files into a separate folder", .0.display())]
    SeriesWithoutNumber(PathBuf),
    /// No limb was found in the scan.
    #[error(transparent)]
    Limb(#[from] ppa_mesh::LimbError),
    /// What was found is far too small for a limb.
    #[error(transparent)]
    NotALimb(#[from] NotALimb),
    /// The landmarks of the limb were not found.
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
#[derive(Clone)]
pub struct PreparedLimb {
    /// The scan.
    pub volume: Volume,
    /// Skin and voxels of the limb.
    pub limb: Arc<Limb>,
    /// Axis, joint and plane.
    pub landmarks: Landmarks,
    /// Findings about scan and limb, severe ones first.
    pub findings: Vec<Finding>,
}

impl PreparedLimb {
    /// Finds the landmarks of a limb; `surface` are the settings that were given for its extraction.
    pub(crate) fn new(
        volume: Volume,
        limb: Arc<Limb>,
        warnings: &[Warning],
        side: Side,
        surface: &LimbSettings,
        choices: &LandmarkOverrides,
    ) -> Result<Self, PrepareError> {
        let landmarks = find_landmarks(&volume, &limb.mesh, &limb.mask, side, choices)?;
        let mut findings: Vec<Finding> = warnings
            .iter()
            .map(of_warning)
            .chain(several_limbs(&limb.report))
            .chain(bodies_kept(&limb.report))
            .chain(part_removed(&limb.report, surface))
            .chain(other_on_side(&limb.report, side, surface))
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
}

/// A reader's warning as a finding.
fn of_warning(warning: &Warning) -> Finding {
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
        text: warning.text.clone(),
        value: None,
        place_mm: None,
    }
}

/// 1 for the left, -1 for the right: in LPS, x grows towards the patient's left.
pub(crate) fn towards_left(side: Side) -> f64 {
    match side {
        Side::Right => -1.0,
        Side::Left => 1.0,
    }
}

/// A body with bone and at least this share of the limb's solid volume may be the intended limb.
const LEAST_OF_LIMB: f64 = 0.1;

/// Finding that another limb is on the requested side, but cut off too much to be selected; `None` if a person selected the limb.
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
        !body.chosen && body.kept.is_empty() && !body.alike && is_on_side && may_be_limb
    })?;
    let (name, other) = match side {
        Side::Right => ("right", "left"),
        Side::Left => ("left", "right"),
    };
    let [x, y, z] = chosen.centre_mm.map(ppa_core::text::number);
    let millilitres = beside.core_mm3 * 1e-3;
    let text = format!(
        "the limb around {x:.0}, {y:.0}, {z:.0} mm was selected, but another one, cut off by the image, lies towards the \
         patient's {name} ({millilitres:.0} ml with little bone): was the {other} limb selected? (--inside selects the other)"
    );
    Some(Finding {
        code: FindingCode::OtherLimbOnSide,
        severity: Severity::Severe,
        text,
        value: Some(beside.core_mm3),
        place_mm: Some(beside.point_mm()),
    })
}

/// Finding that bodies were added to the limb.
fn bodies_kept(report: &LimbReport) -> Option<Finding> {
    let kept = report.bodies.iter().filter(|body| !body.kept.is_empty());
    let largest = kept.clone().next()?;
    let millilitres: f64 = kept.clone().map(|body| body.core_mm3 * 1e-3).sum();
    let bodies = ppa_core::text::count_as(kept.count(), "further body", "further bodies");
    Some(Finding {
        code: FindingCode::BodyKept,
        severity: Severity::Note,
        text: format!(
            "surface.kept of the case adds {bodies} of {millilitres:.0} ml (solid core) to the limb: skin, placement, body \
             shapes and radiographs include them"
        ),
        value: Some(1e3 * millilitres),
        place_mm: Some(largest.point_mm()),
    })
}

/// Finding that parts of the limb were removed.
fn part_removed(report: &LimbReport, settings: &LimbSettings) -> Option<Finding> {
    let balls = settings.removed.iter();
    let largest = balls.max_by(|a, b| a.radius_mm.total_cmp(&b.radius_mm))?;
    let millilitres = report.removed_mm3 * 1e-3;
    let balls = ppa_core::text::count_as(settings.removed.len(), "ball", "balls");
    Some(Finding {
        code: FindingCode::PartRemoved,
        severity: Severity::Caution,
        text: format!(
            "surface.removed of the case removes {millilitres:.0} ml of tissue in {balls}: where that cuts the limb, its \
             surface is not skin"
        ),
        value: Some(report.removed_mm3),
        place_mm: Some(largest.centre_mm),
    })
}

/// Finding that states which of several limbs was selected.
fn several_limbs(report: &LimbReport) -> Option<Finding> {
    let alike = report.bodies.iter().filter(|body| body.alike).count();
    let chosen = report.bodies.iter().find(|body| body.chosen)?;
    let [x, y, z] = chosen.centre_mm.map(ppa_core::text::number);
    (alike > 1).then(|| Finding {
        code: FindingCode::SeveralLimbs,
        severity: Severity::Caution,
        text: format!(
            "the scan shows {alike} limbs; the one around {x:.0}, {y:.0}, {z:.0} mm was selected (--inside selects another)"
        ),
        value: Some(alike as f64),
        place_mm: Some(chosen.point_mm()),
    })
}

#[cfg(test)]
mod tests {
    use ppa_mesh::Body;

    use super::*;

    fn body(chosen: bool, core_mm3: f64, x: f64) -> Body {
        Body {
            chosen,
            alike: chosen,
            kept: Vec::new(),
            core_mm3,
            bone_mm3: 1e-2 * core_mm3,
            side_cut_mm2: 0.0,
            centre_mm: [x, 80.0, 400.0],
            inside_mm: None,
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
