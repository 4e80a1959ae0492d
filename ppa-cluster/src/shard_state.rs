//! State of a shard, from its files and the queue.

use std::fmt;

use serde::Serialize;

use crate::queue::QueuedJob;

/// State of a shard or of the merged dataset.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ShardState {
    /// All of its poses are made.
    Done,
    /// A job is making it, or is ending.
    Running,
    /// A job waits for it.
    Queued,
    /// It was started, is not complete, and no job is left.
    Failed,
    /// It was never started, and no job waits for it.
    Missing,
}

impl fmt::Display for ShardState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Done => "done",
            Self::Running => "running",
            Self::Queued => "queued",
            Self::Failed => "failed",
            Self::Missing => "missing",
        })
    }
}

/// Returns the state of a shard; `job` is its job in the queue, `started` whether it left a log or a folder.
pub fn shard_state(complete: bool, job: Option<&QueuedJob>, started: bool) -> ShardState {
    match (job, started) {
        _ if complete => ShardState::Done,
        (Some(job), _) if job.is_pending() => ShardState::Queued,
        (Some(_), _) => ShardState::Running,
        (None, true) => ShardState::Failed,
        (None, false) => ShardState::Missing,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::queue::JobKind;

    #[test]
    fn files_come_before_the_queue_and_the_queue_before_logs() {
        let job = |state: &str| QueuedJob {
            id: "1_1".to_owned(),
            kind: JobKind::Shard(1),
            state: state.to_owned(),
            node: String::new(),
            reason: String::new(),
        };
        let (pending, running) = (job("PENDING"), job("COMPLETING"));
        assert_eq!(shard_state(true, Some(&running), true), ShardState::Done);
        assert_eq!(
            shard_state(false, Some(&running), true),
            ShardState::Running
        );
        assert_eq!(shard_state(false, Some(&pending), true), ShardState::Queued);
        assert_eq!(shard_state(false, None, true), ShardState::Failed);
        assert_eq!(shard_state(false, None, false), ShardState::Missing);
    }
}
