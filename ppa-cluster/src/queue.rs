//! The jobs of a folder in Slurm's queue, as `squeue` prints them.

use serde::Serialize;

use crate::error::SlurmError;

/// The columns that [`parse_queue`] reads. The comment comes last.
pub(crate) const FORMAT: &str = "%i|%T|%N|%r|%k";

/// What a job makes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum JobKind {
    /// A shard, counted from 1.
    Shard(u64),
    /// The merged dataset.
    Merge,
}

impl JobKind {
    /// The comment of a job array, which names its chunk, or of the merge.
    pub(crate) fn comment(offset: Option<u64>) -> String {
        match offset {
            Some(offset) => format!("shards {offset}"),
            None => "merge".to_owned(),
        }
    }
}

/// One task or job in the queue.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct QueuedJob {
    /// Slurm's identifier, `4711_3` or `4712`.
    pub id: String,
    /// What the job makes.
    pub kind: JobKind,
    /// State, such as `PENDING` or `RUNNING`.
    pub state: String,
    /// Nodes; empty before the job starts.
    pub node: String,
    /// Reason for waiting, such as `Resources`; empty if Slurm gives none.
    pub reason: String,
}

impl QueuedJob {
    /// Whether the job is waiting to start; all others are running or ending.
    pub fn is_pending(&self) -> bool {
        self.state == "PENDING"
    }

    /// Slurm's identifier of the array, or of the job if it is not in an array.
    pub fn array_id(&self) -> &str {
        self.id.split('_').next().unwrap_or(&self.id)
    }
}

/// Reads the output of `squeue --noheader --array --format=%i|%T|%N|%r|%k`. Jobs with other comments are skipped.
///
/// # Errors
/// [`SlurmError::Answer`] with the first malformed line.
pub fn parse_queue(text: &str) -> Result<Vec<QueuedJob>, SlurmError> {
    let mut jobs = Vec::new();
    for line in text.lines().filter(|line| !line.trim().is_empty()) {
        let malformed = || SlurmError::Answer {
            program: "squeue",
            found: line.to_owned(),
            expected: "a job as ID|STATE|NODE|REASON|COMMENT",
        };
        let mut columns = line.trim().splitn(5, '|').map(str::trim);
        let mut column = || columns.next().ok_or_else(malformed);
        let (id, state, node, reason) = (column()?, column()?, column()?, column()?);
        let comment = column()?;
        let kind = match comment.split_once(' ') {
            None if comment == "merge" => JobKind::Merge,
            Some(("shards", offset)) => {
                let index = id.split_once('_').map(|(_, index)| index);
                let index: Option<u64> = index.and_then(|index| index.parse().ok());
                let offset: Option<u64> = offset.parse().ok();
                let shard = index
                    .zip(offset)
                    .and_then(|(i, offset)| i.checked_add(offset));
                JobKind::Shard(shard.ok_or_else(malformed)?)
            }
            _ => continue,
        };
        jobs.push(QueuedJob {
            id: id.to_owned(),
            kind,
            state: state.to_owned(),
            node: node.to_owned(),
            reason: if reason == "None" { "" } else { reason }.to_owned(),
        });
    }
    Ok(jobs)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tasks_and_the_merge_are_read() {
        let text = "3_3|PENDING||JobArrayTaskLimit|shards 1000\n\
            3_1|RUNNING|n1|None|shards 0\n\
            4|PENDING||Dependency|merge\n\
            5|RUNNING|n2|None|(null)\n";
        let jobs = parse_queue(text).unwrap();
        let kinds: Vec<_> = jobs.iter().map(|job| job.kind).collect();
        assert_eq!(
            kinds,
            [JobKind::Shard(1003), JobKind::Shard(1), JobKind::Merge]
        );
        assert!(jobs[0].is_pending() && !jobs[1].is_pending());
        assert_eq!((jobs[0].array_id(), jobs[2].array_id()), ("3", "4"));
        assert_eq!((&*jobs[1].node, &*jobs[1].reason), ("n1", ""));
        assert_eq!(jobs[0].reason, "JobArrayTaskLimit");
        assert_eq!(parse_queue("\n").unwrap(), []);
    }

    #[test]
    fn lines_of_another_form_are_refused() {
        for line in [
            "3_1|RUNNING",
            "slurm_load_jobs error: Unable to contact slurm controller",
            "3_[1-4]|PENDING||None|shards 0",
            "3|PENDING||None|shards 0",
            "3_1|PENDING||None|shards x",
        ] {
            let said = parse_queue(line).unwrap_err().to_string();
            assert!(said.contains(line) && said.contains("expected"), "{said}");
        }
    }
}
