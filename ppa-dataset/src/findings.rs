//! Findings: doubts about a limb or a pose, passed on with the data from the case to training.
//!
//! `ppa prepare` writes them into the case; a dataset lists those of all its limbs in `findings.json`. A person who has
//! checked a severe one adds its code to `acknowledged` of the case; until then, commands that use the limb repeat it.

use std::fmt;
use std::fs;
use std::io;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::archive::require_folder;
use crate::files::{FileError, read_text};
use crate::layout::LimbId;

/// Importance of a finding.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Severity {
    /// For information only.
    Note,
    /// Check the limb before using its images.
    Caution,
    /// The images are probably wrong.
    Severe,
}

/// Kinds of [`Finding`]; written in kebab-case, e.g. `limb-too-small`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum FindingCode {
    /// A warning from reading the scan.
    ScanWarning,
    /// The scan shows several limbs.
    SeveralLimbs,
    /// Another limb, cut off by the image, is on the requested side.
    OtherLimbOnSide,
    /// A person kept a further body as a part of the limb.
    BodyKept,
    /// A person removed a part of the scan.
    PartRemoved,
    /// The limb is too thin or too short to be a limb.
    LimbTooSmall,
    /// The limb is too thick to be a limb, for example a trunk.
    LimbTooLarge,
    /// A part of another limb is fused to the skin.
    FusedLimb,
    /// The field of view cuts the limb somewhere other than at its end.
    CutLimb,
    /// The field of view cuts the limb within a region of interest.
    CutInRegion,
    /// The supporting plane is on a face where the field of view cuts the limb.
    PlaneOnCut,
    /// The normal of the supporting plane is parallel to an axis of the image.
    PlaneAlongImage,
    /// The distal and proximal contacts with the table are too close together to determine the pitch.
    ContactsTooNear,
    /// A person gave the supporting plane.
    PlaneGiven,
    /// The axis of rotation is inclined to the shaft of the bone.
    AxisOffShaft,
    /// The axis of a lower leg passes through the centres of the skin's cross-sections, not of the tibia's.
    AxisWithoutBone,
    /// The regions that define the axis are closer together than in a sufficiently long scan.
    RegionsCloser,
    /// The fibula is where it would be in a limb of the other side.
    SideMismatch,
    /// The anterior direction points to the patient's back.
    AnteriorReversed,
    /// Neither an ankle nor a knee was found.
    NoJoint,
    /// The joint centre is outside the limb.
    JointOutside,
    /// The joint is not at the ankle visible in the scan.
    JointOffAnkle,
    /// The joint is outside the radiograph.
    JointOffDetector,
    /// The joint was not on the axis that a person gave.
    JointOffAxis,
    /// The scan shows another joint than the one the limb is posed about.
    OtherJoint,
    /// The scan cuts off the tibial plateau of a knee.
    PlateauCut,
    /// The axis of a knee runs along the femur, or through femur and tibia.
    KneeAxis,
    /// The scan does not show the back of both condyles of a knee.
    CondylesNotSeen,
    /// The limb points the opposite way to the scan's stated orientation.
    ProximalIsInferior,
}

impl fmt::Display for Severity {
    /// Writes the name used in files.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.serialize(f)
    }
}

impl fmt::Display for FindingCode {
    /// Writes the name used in files.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.serialize(f)
    }
}

/// One doubt about a limb or a pose.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Finding {
    /// Stable code for scripts and for `acknowledged` in a case.
    pub code: FindingCode,
    /// Severity of the finding.
    pub severity: Severity,
    /// What was found and expected, in one sentence with units.
    pub text: String,
    /// The number that was compared with a limit; `text` gives its unit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub value: Option<f64>,
    /// Place of the finding: a point in the ct frame (LPS), mm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub place_mm: Option<[f64; 3]>,
}

/// A finding about one limb of a dataset.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LimbFinding {
    /// The limb.
    #[serde(flatten)]
    pub limb: LimbId,
    /// Whether the case acknowledges it by name.
    pub acknowledged: bool,
    /// The finding itself.
    #[serde(flatten)]
    pub finding: Finding,
}

impl Finding {
    /// The line in which commands repeat a severe finding of the limb named `limb`, which has `more` further findings of the same code.
    pub fn repeated(&self, limb: &str, more: usize) -> String {
        let more = match more {
            0 => String::new(),
            more => format!(" (and {more} more)"),
        };
        format!(
            "{} [{}] {limb}: {}{more}; acknowledge it in the case once you have looked",
            self.severity, self.code, self.text
        )
    }
}

impl LimbFinding {
    /// Whether commands have to repeat the finding: it is severe and not acknowledged.
    pub fn is_open(&self) -> bool {
        self.finding.severity == Severity::Severe && !self.acknowledged
    }
}

/// The findings of a dataset, `findings.json`; there is no file if there are none.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Findings(pub Vec<LimbFinding>);

impl Findings {
    /// Its file in a dataset.
    pub const FILE: &str = "findings.json";

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Reads the findings of the dataset in `root`; none if the file is absent.
    ///
    /// # Errors
    /// [`FileError`] when the file cannot be read or is malformed.
    pub fn read(root: &Path) -> Result<Self, FileError> {
        require_folder(root)?;
        let path = root.join(Self::FILE);
        match fs::exists(&path) {
            Ok(false) => return Ok(Self::default()),
            Err(error) => return Err(FileError::at("read", &path)(error)),
            Ok(true) => {}
        }
        Self::of_text(&read_text(&path)?, &path)
    }

    /// Parses the text of a `findings.json` that was read from `path`.
    ///
    /// # Errors
    /// [`FileError`] when it is malformed.
    pub fn of_text(text: &str, path: &Path) -> Result<Self, FileError> {
        serde_json::from_str(text).map_err(|e| FileError::at("parse", path)(io::Error::from(e)))
    }

    /// The open findings of several datasets, one line for each code and limb; a dataset named twice is read once.
    ///
    /// # Errors
    /// The same as [`Findings::read`].
    pub fn open_lines_of<'a>(
        datasets: impl IntoIterator<Item = &'a Path>,
    ) -> Result<Vec<String>, FileError> {
        let mut known: Vec<&Path> = Vec::new();
        let mut lines = Vec::new();
        for dataset in datasets {
            if !known.contains(&dataset) {
                known.push(dataset);
                let of = format!(" of {}", dataset.display());
                lines.extend(Self::read(dataset)?.open_lines(&of));
            }
        }
        Ok(lines)
    }

    /// The open findings, one line for each code and limb; `of` follows the limb's name.
    pub fn open_lines(&self, of: &str) -> Vec<String> {
        let open: Vec<&LimbFinding> = self.0.iter().filter(|found| found.is_open()).collect();
        let alike =
            |a: &LimbFinding, b: &LimbFinding| a.limb == b.limb && a.finding.code == b.finding.code;
        let mut lines = Vec::new();
        for (i, found) in open.iter().enumerate() {
            if open[..i].iter().any(|earlier| alike(earlier, found)) {
                continue;
            }
            let more = open[i + 1..].iter().filter(|later| alike(later, found));
            let LimbId { patient, .. } = found.limb;
            let limb = format!("limb {} of patient {patient}{of}", found.limb.side_letter());
            lines.push(found.finding.repeated(&limb, more.count()));
        }
        lines
    }

    /// `findings.json` as text.
    pub fn to_text(&self) -> String {
        serde_json::to_string_pretty(self).expect("findings hold only JSON values")
    }

    /// Adds the findings of one pose of `limb` that are not listed already.
    pub fn add(&mut self, limb: LimbId, acknowledged: &[FindingCode], of_pose: &[Finding]) {
        for finding in of_pose {
            let same = |known: &LimbFinding| known.limb == limb && known.finding == *finding;
            if !self.0.iter().any(same) {
                self.0.push(LimbFinding {
                    limb,
                    acknowledged: acknowledged.contains(&finding.code),
                    finding: finding.clone(),
                });
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::Side;

    fn found(
        patient: u32,
        code: FindingCode,
        severity: Severity,
        acknowledged: bool,
    ) -> LimbFinding {
        LimbFinding {
            limb: LimbId {
                patient,
                side: Side::Right,
            },
            acknowledged,
            finding: Finding {
                code,
                severity,
                text: "the fibula lies medially".to_owned(),
                value: None,
                place_mm: None,
            },
        }
    }

    #[test]
    fn open_findings_take_one_line_per_limb_and_code() {
        use FindingCode::{CutInRegion, SideMismatch};
        let findings = Findings(vec![
            found(0, SideMismatch, Severity::Severe, false),
            found(0, CutInRegion, Severity::Severe, false),
            found(0, CutInRegion, Severity::Severe, false),
            found(1, SideMismatch, Severity::Severe, true),
            found(2, SideMismatch, Severity::Caution, false),
        ]);
        let end = "acknowledge it in the case once you have looked";
        assert_eq!(
            findings.open_lines(""),
            [
                format!(
                    "severe [side-mismatch] limb r of patient 0: the fibula lies medially; {end}"
                ),
                format!(
                    "severe [cut-in-region] limb r of patient 0: the fibula lies medially (and 1 more); {end}"
                ),
            ]
        );
    }
}
