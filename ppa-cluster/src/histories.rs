//! Division of a command's histories into parts.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use crate::bundle::RESERVE;
use crate::time_limit::TimeLimit;

/// Intended time of a task, seconds.
const TARGET_S: f64 = 30.0 * 60.0;

/// Interval between TERM and the time limit of a task, seconds: histories end within a second, but writing a tally of many voxels takes
/// longer, and Slurm may warn up to a minute earlier than asked.
pub(crate) const WARNING_S: u64 = 180;

/// The command whose histories are divided.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum HistoryCommand {
    /// `ppa xray simulate`.
    Simulate,
    /// `ppa xray mcgpu`.
    Mcgpu,
}

/// A command that follows histories, one part per task.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct HistoryWork {
    /// The command.
    #[serde(flatten)]
    pub divided: DividedCommand,
    /// Parts of the histories of each projection, one per task.
    pub parts: u64,
    /// Measured processor time; absent if the user gave the number of tasks.
    pub cost: Option<HistoryCost>,
}

/// A command line whose histories are divided.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct DividedCommand {
    /// The command.
    pub command: HistoryCommand,
    /// Arguments after `ppa`, except those in `outputs`.
    pub words: Vec<String>,
    /// Arguments that name outputs, for the last job only.
    pub outputs: Vec<String>,
    /// Folder against which relative paths are resolved.
    pub folder: PathBuf,
    /// Histories of each projection.
    pub histories: u64,
    /// Projections; 1 for a radiograph.
    pub projections: u64,
    /// SHA-256 of the program: tallies of different programs cannot be merged.
    pub program_sha256: String,
}

impl DividedCommand {
    /// Histories of all projections.
    pub fn all_histories(&self) -> u64 {
        self.histories.saturating_mul(self.projections)
    }
}

/// Processor time of histories, seconds.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct HistoryCost {
    /// Time of a million histories.
    pub million_cpu_s: f64,
    /// Time to read and prepare the input, in each task.
    pub preparation_cpu_s: f64,
}

impl HistoryCost {
    /// Processor time of `histories` in `tasks` tasks, seconds.
    pub fn total_cpu_s(&self, histories: u64, tasks: u64) -> f64 {
        self.million_cpu_s * histories as f64 / 1e6 + self.preparation_cpu_s * tasks as f64
    }
}

/// Why histories cannot be divided.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum HistoriesError {
    /// The time limit leaves too little time after the preparation.
    #[error(
        "the time limit {limit} is too short: a task prepares for {preparation_s:.0} s and stops {WARNING_S} s before its limit; give at least --time {least}"
    )]
    TooShort {
        /// The time limit.
        limit: TimeLimit,
        /// Estimated time before the first history, seconds.
        preparation_s: f64,
        /// The shortest limit that is accepted.
        least: TimeLimit,
    },
}

/// Divides `histories`, the total of all projections, into parts that take half an hour on `cpus` processors, or two thirds of the time
/// limit if that is less.
///
/// # Errors
/// [`HistoriesError::TooShort`].
pub fn divide_histories(
    histories: u64,
    cost: HistoryCost,
    cpus: u32,
    limit: TimeLimit,
) -> Result<u64, HistoriesError> {
    let usable_s = limit.seconds() as f64 - WARNING_S as f64;
    // The histories get at least as much time as the preparation, which may use one processor only.
    let preparation_s = cost.preparation_cpu_s;
    let least_s = (2.0 * preparation_s).max(60.0);
    if usable_s < least_s {
        let least = (least_s + WARNING_S as f64) / 60.0;
        return Err(HistoriesError::TooShort {
            limit,
            preparation_s,
            least: TimeLimit::from_seconds(least.ceil() as u64 * 60),
        });
    }
    let task_s = (TARGET_S.min(usable_s / RESERVE) - preparation_s).max(least_s / 2.0);
    let follow_s = cost.total_cpu_s(histories, 0) / f64::from(cpus.max(1));
    let parts = (follow_s / task_s).ceil().max(1.0) as u64;
    Ok(parts.min(histories.max(1)))
}

#[cfg(test)]
mod tests {
    use super::*;

    const COST: HistoryCost = HistoryCost {
        million_cpu_s: 2.0,
        preparation_cpu_s: 10.0,
    };

    #[test]
    fn parts_take_half_an_hour_or_less() {
        let parts = |cpus, limit| {
            let limit = TimeLimit::from_seconds(limit);
            divide_histories(20_000_000_000, COST, cpus, limit).unwrap()
        };
        // 40,000 CPU s in tasks of 1800 s, of which 10 s prepare.
        assert_eq!(parts(1, 7200), 23);
        assert_eq!(parts(4, 7200), 6);
        // (1380 - 180) / 1.5 - 10 = 790 s.
        assert_eq!(parts(1, 1380), 51);
    }

    #[test]
    fn few_histories_are_one_part() {
        let limit = TimeLimit::from_seconds(7200);
        assert_eq!(divide_histories(1, COST, 1, limit), Ok(1));
    }

    #[test]
    fn a_limit_for_preparation_alone_is_refused() {
        let limit = TimeLimit::from_seconds(200);
        let refused = divide_histories(1, COST, 1, limit).unwrap_err();
        assert!(
            refused.to_string().ends_with("--time 00:04:00"),
            "{refused}"
        );
        let HistoriesError::TooShort { least, .. } = refused;
        assert_eq!(divide_histories(1, COST, 1, least), Ok(1));
    }
}
