//! Where the shards of a plan on a cluster stand: from their files, their logs and the queue.

use std::collections::BTreeMap;
use std::path::Path;

use ppa_cluster::{
    ClusterFolder, CoreHours, JobKind, QueuedJob, ShardState, Submission, last_line, logged_shards,
    shard_state,
};
use ppa_core::text::count;
use ppa_generate::status;
use serde::Serialize;

/// One shard, or the merge.
#[derive(Debug, Serialize)]
pub struct JobReport {
    pub state: ShardState,
    /// Poses that are made.
    pub made: usize,
    /// Slurm's identifier, while it is in the queue.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub job: Option<String>,
    #[serde(skip_serializing_if = "String::is_empty")]
    pub node: String,
    /// Why it waits.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub reason: String,
    /// Last line of its log.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub last_line: Option<String>,
}

/// A shard by its number.
#[derive(Debug, Serialize)]
pub struct ShardReport {
    pub shard: u64,
    #[serde(flatten)]
    pub report: JobReport,
}

/// All shards of a folder, and their merge.
#[derive(Debug, Serialize)]
pub struct ClusterReport {
    /// Poses of the plan.
    #[serde(rename = "units")]
    pub poses: u64,
    /// Poses that are made.
    pub made: usize,
    /// Shards by state.
    pub states: BTreeMap<ShardState, usize>,
    pub core_hours: CoreHours,
    pub shards: Vec<ShardReport>,
    pub merge: JobReport,
}

impl ClusterReport {
    /// Reads the files of a folder; `queue` holds its jobs.
    pub fn of(
        folder: &ClusterFolder,
        submission: &Submission,
        queue: &[QueuedJob],
    ) -> anyhow::Result<Self> {
        let job_of = |kind| queue.iter().find(|job| job.kind == kind);
        let logs = logged_shards(&folder.logs())?;
        let shard = |shard: u64| {
            let (root, log) = (folder.shard(shard), logs.get(&shard));
            let job = job_of(JobKind::Shard(shard));
            let log = log.map(|log| log.as_path());
            ShardReport {
                shard,
                report: report(&root, true, job, log),
            }
        };
        let shards: Vec<_> = (1..=submission.bundle.shards).map(shard).collect();
        let mut states = BTreeMap::new();
        for shard in &shards {
            *states.entry(shard.report.state).or_insert(0) += 1;
        }
        let made = shards.iter().map(|shard| shard.report.made).sum();
        let with = |state| states.get(&state).copied().unwrap_or(0);
        let (done, running) = (with(ShardState::Done), with(ShardState::Running));
        let finished = (made as u64, done as u64);
        let core_hours = CoreHours::of(submission, finished, running, &folder.logs())?;
        let log = folder.merge_log();
        let log = log.is_file().then_some(log);
        Ok(Self {
            poses: submission.poses,
            made,
            states,
            core_hours,
            shards,
            merge: report(
                &folder.dataset(),
                folder.is_verified()?,
                job_of(JobKind::Merge),
                log.as_deref(),
            ),
        })
    }

    /// Shards that no job makes and that are not complete.
    pub fn lost(&self) -> Vec<u64> {
        let is_lost = |state| matches!(state, ShardState::Failed | ShardState::Missing);
        let lost = self.shards.iter().filter(|s| is_lost(s.report.state));
        lost.map(|shard| shard.shard).collect()
    }

    /// Whether a task or the merge runs or waits, be it for a shard that is made again.
    pub fn is_under_way(&self) -> bool {
        let reports = self.shards.iter().map(|shard| &shard.report);
        let mut reports = reports.chain([&self.merge]);
        reports.any(|report| report.job.is_some() || report.state == ShardState::Running)
    }

    fn core_hours(&self) -> String {
        let hours = &self.core_hours;
        let left = match hours.left_hours {
            Some(wall) => format!(
                ", {:.2} left: {wall:.2} hours if as many tasks run as now",
                hours.left
            ),
            None if hours.left > 0.0 => format!(", {:.2} left", hours.left),
            None => String::new(),
        };
        format!(
            "core hours {:.2} estimated, {:.2} used by tasks that have ended{left}",
            hours.estimated, hours.used
        )
    }

    /// The report in words: a line for each shard that is not done, since there may be thousands.
    pub fn describe(&self) -> String {
        let states = self.states.iter();
        let states: Vec<_> = states.map(|(state, n)| format!("{n} {state}")).collect();
        let mut lines = vec![format!(
            "{}: {}; {} of {} made",
            count(self.shards.len(), "shard"),
            states.join(", "),
            self.made,
            count(self.poses, "pose")
        )];
        lines.push(self.core_hours());
        for shard in &self.shards {
            if shard.report.state != ShardState::Done {
                lines.push(line(&format!("shard {}", shard.shard), &shard.report));
            }
        }
        lines.push(line("merge", &self.merge));
        lines.join("\n")
    }
}

fn report(dataset: &Path, also: bool, job: Option<&QueuedJob>, log: Option<&Path>) -> JobReport {
    // A folder that was not begun or is damaged holds nothing that counts.
    let found = status(dataset).ok();
    let complete = also && found.as_ref().is_some_and(|found| found.complete);
    let made_elsewhere = job.is_none() && found.as_ref().is_some_and(|found| found.running);
    let started = log.is_some() || found.is_some();
    let text = |of: fn(&QueuedJob) -> &String| job.map(of).cloned().unwrap_or_default();
    JobReport {
        state: match made_elsewhere {
            true => ShardState::Running,
            false => shard_state(complete, job, started),
        },
        made: found.map_or(0, |found| found.made),
        job: job.map(|job| job.id.clone()),
        node: text(|job| &job.node),
        reason: text(|job| &job.reason),
        last_line: log.and_then(last_line),
    }
}

fn line(what: &str, report: &JobReport) -> String {
    let mut text = format!("{what:<10} {:<7}", report.state.to_string());
    let job = report.job.as_ref().map(|job| format!("job {job}"));
    let node = (!report.node.is_empty()).then(|| format!("on {}", report.node));
    let reason = (!report.reason.is_empty()).then(|| format!("({})", report.reason));
    let last = report.last_line.as_ref().map(|last| format!("- {last}"));
    for part in [job, node, reason, last].into_iter().flatten() {
        text += &format!(" {part}");
    }
    text.trim_end().to_owned()
}
