//! Commands whose histories `ppa submit` divides into tasks.

use std::path::PathBuf;
use std::time::Duration;

/// How long histories are simulated to measure their time.
pub(super) const MEASURE: Duration = Duration::from_secs(3);

/// The histories of a command.
pub struct Divisible {
    /// Its case or input file.
    pub input: PathBuf,
    /// Histories of each projection.
    pub histories: u64,
    /// Number of projections; 1 for a radiograph.
    pub projections: u64,
}

/// Refuses the first given option that `ppa submit` sets for tasks, or that depends on all histories.
pub(super) fn refuse_given(options: &[(&str, bool)]) -> anyhow::Result<()> {
    match options.iter().find(|(_, given)| *given) {
        Some((option, _)) => anyhow::bail!(
            "{option} cannot be given for a command whose histories ppa submit divides"
        ),
        None => Ok(()),
    }
}
