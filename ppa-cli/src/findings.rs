//! Severe findings that no case acknowledges, repeated on stderr.

use std::path::Path;

use anyhow::Context;
use ppa_dataset::Findings;
use ppa_generate::{Case, PreparedLimb};

use crate::stderr::warning;

/// Repeats the findings of datasets that are about to be used.
pub fn repeat_of_datasets<'a>(datasets: impl Iterator<Item = &'a Path>) -> anyhow::Result<()> {
    for line in Findings::open_lines_of(datasets)? {
        warning(&line);
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
        warning(&finding.repeated(&limb, 0));
    }
    Ok(prepared)
}
