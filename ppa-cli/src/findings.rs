//! Severe findings that no case acknowledges, repeated on stderr.

use std::path::Path;

use anyhow::Context;
use ppa_dataset::layout::LimbId;
use ppa_dataset::{Finding, Findings, LimbFinding};
use ppa_generate::{Case, PreparedLimb};

use crate::stderr::warning;

/// Repeats those of datasets that are about to be used.
pub fn repeat_of_datasets<'a>(datasets: impl Iterator<Item = &'a Path>) -> anyhow::Result<()> {
    let mut known: Vec<&Path> = Vec::new();
    for dataset in datasets {
        if known.contains(&dataset) {
            continue;
        }
        known.push(dataset);
        let findings = Findings::read(dataset)?;
        for line in lines(&findings, &format!(" of {}", dataset.display())) {
            warning(&line);
        }
    }
    Ok(())
}

/// Prepares the limb of a case and repeats its open findings.
pub fn prepared(case: &Case, file: &Path) -> anyhow::Result<PreparedLimb> {
    let prepared = PreparedLimb::of_case(case)
        .with_context(|| format!("cannot prepare the limb of {}", file.display()))?;
    let side = case.side.letter();
    for finding in prepared.open_findings(&case.acknowledged) {
        let limb = format!("limb {side} of {}", file.display());
        warning(&line(finding, &limb, 0));
    }
    Ok(prepared)
}

/// The open findings of a dataset or plan, one line for each code and limb; `of` follows the limb's name.
pub fn lines(findings: &Findings, of: &str) -> Vec<String> {
    let open: Vec<&LimbFinding> = findings.0.iter().filter(|found| found.is_open()).collect();
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
        lines.push(line(&found.finding, &limb, more.count()));
    }
    lines
}

/// `more` is how many findings of the same code the limb has besides.
fn line(finding: &Finding, limb: &str, more: usize) -> String {
    let more = match more {
        0 => String::new(),
        more => format!(" (and {more} more)"),
    };
    format!(
        "{} [{}] {limb}: {}{more}; acknowledge it in the case once you have looked",
        finding.severity, finding.code, finding.text
    )
}

#[cfg(test)]
mod tests {
    use ppa_dataset::layout::Side;
    use ppa_dataset::{FindingCode, Severity};

    use super::*;

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
            lines(&findings, ""),
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
