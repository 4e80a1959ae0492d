//! State of the tasks of a submission, from their files, logs and the queue.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use ppa_cluster::{
    ClusterFolder, CoreHours, HistoryWork, JobKind, QueuedJob, ShardState, Submission, Work,
    last_line, logged_tasks, shard_state,
};
use ppa_core::text::count;
use ppa_generate::status;
use ppa_xray::AnalogTally;
use serde::Serialize;

/// One task, or the last job.
#[derive(Debug, Serialize)]
pub struct JobReport {
    pub state: ShardState,
    /// Number of finished poses, finished training runs, or simulated histories.
    pub made: u64,
    /// Slurm's identifier while the job is in the queue.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub job: Option<String>,
    #[serde(skip_serializing_if = "String::is_empty")]
    pub node: String,
    /// Why it is waiting.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub reason: String,
    /// Last line of its log.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub last_line: Option<String>,
}

/// A task with its number.
#[derive(Debug, Serialize)]
pub struct ShardReport {
    pub shard: u64,
    /// Folder of the training run of this task.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub training: Option<String>,
    #[serde(flatten)]
    pub report: JobReport,
}

/// All tasks of a folder, and the last job.
#[derive(Debug, Serialize)]
pub struct ClusterReport {
    /// Poses, training runs or histories of all tasks.
    #[serde(rename = "units")]
    pub all: u64,
    /// Number of these that are finished.
    pub made: u64,
    /// Number of tasks in each state.
    pub states: BTreeMap<ShardState, usize>,
    pub core_hours: CoreHours,
    pub shards: Vec<ShardReport>,
    /// The job that merges or writes the tables.
    pub merge: JobReport,
    #[serde(skip)]
    names: Names,
}

/// Names of a task and of the last job, and the kind of their results.
#[derive(Debug)]
struct Names {
    task: &'static str,
    last: &'static str,
    made: Made,
}

/// Kind of a task's results.
#[derive(Debug)]
enum Made {
    Poses,
    /// One per task.
    Trainings,
    Histories,
}

impl ClusterReport {
    /// Reads the files of a folder; `queue` holds its jobs.
    pub fn of(
        folder: &ClusterFolder,
        submission: &Submission,
        queue: &[QueuedJob],
    ) -> anyhow::Result<Self> {
        let job_of = |kind| queue.iter().find(|job| job.kind == kind);
        let logs = logged_tasks(&folder.logs())?;
        let task = |shard: u64, training: Option<&str>, found: &Found| {
            let log = logs.get(&shard).map(|log| log.as_path());
            ShardReport {
                shard,
                training: training.map(str::to_owned),
                report: report(found, job_of(JobKind::Shard(shard)), log),
            }
        };
        let numbers = 1..=submission.work.tasks();
        let shards: Vec<_> = match &submission.work {
            Work::Poses(work) => numbers
                .map(|shard| task(shard, None, &Found::dataset(&folder.shard(work, shard))))
                .collect(),
            Work::Trainings(work) => numbers
                .zip(work.trainings())
                .map(|(number, training)| {
                    task(number, Some(training), &Found::training(folder, training))
                })
                .collect(),
            Work::Histories(work) => numbers
                .map(|number| task(number, None, &Found::histories(&folder.part(number), work)))
                .collect(),
        };
        let mut states = BTreeMap::new();
        for shard in &shards {
            *states.entry(shard.report.state).or_insert(0) += 1;
        }
        let made = shards.iter().map(|shard| shard.report.made).sum();
        let with = |state| states.get(&state).copied().unwrap_or(0);
        let (done, running) = (with(ShardState::Done), with(ShardState::Running));
        let is_done = |shard: &&ShardReport| shard.report.state == ShardState::Done;
        let finished = shards.iter().filter(is_done);
        let finished: Vec<&Path> = finished
            .filter_map(|shard| logs.get(&shard.shard).map(|log| log.as_path()))
            .collect();
        let made_by = (made, done as u64);
        let core_hours = CoreHours::of(submission, made_by, &finished, running, &folder.logs())?;
        let log = folder.last_log(&submission.work);
        let log = log.is_file().then_some(log);
        let is_done = folder.is_done()?;
        let last = match &submission.work {
            Work::Poses(work) => {
                let merged = Found::dataset(&folder.dataset(work));
                Found {
                    complete: merged.complete && is_done,
                    ..merged
                }
            }
            Work::Trainings(_) | Work::Histories(_) => Found {
                complete: is_done,
                ..Found::default()
            },
        };
        let work = &submission.work;
        Ok(Self {
            all: match work {
                Work::Poses(work) => work.poses,
                Work::Trainings(_) => work.tasks(),
                Work::Histories(work) => work.divided.all_histories(),
            },
            made,
            states,
            core_hours,
            shards,
            merge: report(&last, job_of(JobKind::Merge), log.as_deref()),
            names: Names {
                task: work.task_name(),
                last: work.last_name(),
                made: match work {
                    Work::Poses(_) => Made::Poses,
                    Work::Trainings(_) => Made::Trainings,
                    Work::Histories(_) => Made::Histories,
                },
            },
        })
    }

    /// Tasks that are neither finished nor queued.
    pub fn lost(&self) -> Vec<u64> {
        let is_lost = |state| matches!(state, ShardState::Failed | ShardState::Missing);
        let lost = self.shards.iter().filter(|s| is_lost(s.report.state));
        lost.map(|shard| shard.shard).collect()
    }

    /// Whether a task or the merge is running or waiting, including shards that are repeated.
    pub fn is_under_way(&self) -> bool {
        let reports = self.shards.iter().map(|shard| &shard.report);
        let mut reports = reports.chain([&self.merge]);
        reports.any(|report| report.job.is_some() || report.state == ShardState::Running)
    }

    fn core_hours(&self) -> String {
        let used = format!("{:.2} used by tasks that have ended", self.core_hours.used);
        let Some(estimate) = &self.core_hours.estimate else {
            return format!("core hours {used}");
        };
        let left = match estimate.left_hours {
            Some(wall) => format!(
                ", {:.2} left: {wall:.2} hours if as many tasks run as now",
                estimate.left
            ),
            None if estimate.left > 0.0 => format!(", {:.2} left", estimate.left),
            None => String::new(),
        };
        format!(
            "core hours {:.2} estimated, {used}{left}",
            estimate.estimated
        )
    }

    /// The report as text: a line for each unfinished task, since there may be thousands of tasks.
    pub fn describe(&self) -> String {
        let states = self.states.iter();
        let states: Vec<_> = states.map(|(state, n)| format!("{n} {state}")).collect();
        let states = states.join(", ");
        let Names { task, last, made } = &self.names;
        let made = match made {
            Made::Trainings => String::new(),
            Made::Histories => {
                let (made, all) = (self.made as f64, self.all as f64);
                format!("; {made:.4e} of {all:.4e} histories followed")
            }
            Made::Poses => format!("; {} of {} made", self.made, count(self.all, "pose")),
        };
        let mut lines = vec![format!(
            "{}: {states}{made}",
            count(self.shards.len(), task)
        )];
        lines.push(self.core_hours());
        for shard in &self.shards {
            if shard.report.state != ShardState::Done {
                let name = match &shard.training {
                    Some(training) => format!("{} {training}", shard.shard),
                    None => format!("{task} {}", shard.shard),
                };
                lines.push(line(&name, &shard.report));
            }
        }
        lines.push(line(last, &self.merge));
        lines.join("\n")
    }
}

/// State of a task according to its files.
#[derive(Default)]
struct Found {
    complete: bool,
    begun: bool,
    made: u64,
    /// Whether a process is writing to it.
    written_now: bool,
}

impl Found {
    /// State of a dataset; the default if the folder is missing or damaged.
    fn dataset(root: &Path) -> Self {
        status(root).map_or(Self::default(), |found| Self {
            complete: found.complete,
            begun: true,
            made: found.made as u64,
            written_now: found.running,
        })
    }

    fn training(folder: &ClusterFolder, training: &str) -> Self {
        let complete = folder.is_trained(training);
        Self {
            complete,
            begun: folder.is_begun(training),
            made: complete.into(),
            written_now: false,
        }
    }

    /// State according to the headers of the tallies of a part; unreadable ones are ignored.
    fn histories(part: &Path, work: &HistoryWork) -> Self {
        let tallies = tallies(part).filter_map(|path| AnalogTally::read_histories(&path).ok());
        let tallies = tallies.filter(|found| found.of_run == work.divided.histories);
        let tallies: Vec<_> = tallies.collect();
        let complete = tallies
            .iter()
            .filter(|found| found.done == found.part)
            .count();
        Self {
            complete: complete as u64 == work.divided.projections,
            begun: part.is_dir(),
            made: tallies
                .iter()
                .map(|found| found.done.end - found.done.start)
                .sum(),
            written_now: false,
        }
    }
}

/// Paths of the tallies in the folder of a part; empty if it cannot be read.
pub fn tallies(part: &Path) -> impl Iterator<Item = PathBuf> {
    let entries = std::fs::read_dir(part).into_iter().flatten().flatten();
    let tallies = entries.map(|entry| entry.path());
    tallies.filter(|path| path.extension().is_some_and(|end| end == "tally"))
}

fn report(found: &Found, job: Option<&QueuedJob>, log: Option<&Path>) -> JobReport {
    let started = log.is_some() || found.begun;
    let text = |of: fn(&QueuedJob) -> &String| job.map(of).cloned().unwrap_or_default();
    JobReport {
        state: match job.is_none() && found.written_now {
            true => ShardState::Running,
            false => shard_state(found.complete, job, started),
        },
        made: found.made,
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
