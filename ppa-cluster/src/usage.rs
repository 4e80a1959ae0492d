//! Core hours of tasks: those used by ended tasks, from the line that each leaves in its log, and estimates.

use std::fs;
use std::io;
use std::path::Path;

use serde::Serialize;

use crate::error::FolderError;
use crate::submission::{Submission, Work};

/// Core hours of a submission: allocated processors times hours.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct CoreHours {
    /// Core hours of ended tasks, from their logs. Running and killed tasks are not counted.
    pub used: f64,
    /// Estimate from the time of a pose or history, or from finished training runs.
    #[serde(flatten)]
    pub estimate: Option<Estimate>,
}

/// Estimated core hours.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Estimate {
    /// Core hours of the entire plan.
    pub estimated: f64,
    /// Core hours of the remaining work.
    pub left: f64,
    /// Hours until that is finished with the current number of running tasks; absent if none is running.
    pub left_hours: Option<f64>,
}

impl CoreHours {
    /// Computes core hours. `made` counts the finished poses, training runs or histories, and the finished tasks; `finished` lists the logs
    /// of these tasks, `running` counts the running tasks, and `logs` is the folder of the logs.
    ///
    /// # Errors
    /// [`FolderError::File`] when the logs cannot be read.
    pub fn of(
        submission: &Submission,
        made: (u64, u64),
        finished: &[&Path],
        running: usize,
        logs: &Path,
    ) -> Result<Self, FolderError> {
        let cores = running as f64 * f64::from(submission.settings.cpus);
        let estimate = match &submission.work {
            Work::Poses(work) => {
                let cpu_s = |poses: u64, shards: u64| {
                    work.cost.pose_cpu_s * poses as f64 + work.cost.limb_cpu_s * shards as f64
                };
                Some(Estimate::of(
                    (work.poses, work.bundle.shards),
                    made,
                    cores,
                    cpu_s,
                ))
            }
            Work::Histories(work) => work.cost.map(|cost| {
                let all = (work.divided.all_histories(), work.parts);
                Estimate::of(all, made, cores, |histories, parts| {
                    cost.total_cpu_s(histories, parts)
                })
            }),
            Work::Trainings(_) => {
                let mut of_finished_s = 0.0;
                for log in finished {
                    of_finished_s += core_s_of(log)?;
                }
                let mean_s = of_finished_s / finished.len().max(1) as f64;
                let all = submission.work.tasks();
                let cpu_s = |_, tasks: u64| mean_s * tasks as f64;
                (mean_s > 0.0).then(|| Estimate::of((all, all), made, cores, cpu_s))
            }
        };
        Ok(Self {
            used: used_core_s(logs)? / 3600.0,
            estimate,
        })
    }
}

impl Estimate {
    /// Estimates from the numbers of `all` and of `made` poses or histories and tasks, the `cores` of the running tasks, and `cpu_s`, the
    /// processor time of poses or histories and tasks in seconds.
    fn of(all: (u64, u64), made: (u64, u64), cores: f64, cpu_s: impl Fn(u64, u64) -> f64) -> Self {
        let left = cpu_s(all.0.saturating_sub(made.0), all.1.saturating_sub(made.1)) / 3600.0;
        Self {
            estimated: cpu_s(all.0, all.1) / 3600.0,
            left,
            left_hours: (cores > 0.0).then(|| left / cores),
        }
    }
}

/// Line that a job script prints when it ends, unless it is killed; `$task` and `$SECONDS` are variables of the script.
pub(crate) fn ended_line(cpus: u32) -> String {
    format!("job $task ended after $SECONDS s with {cpus} cores")
}

/// Core seconds in the line that a task prints when it ends; `None` for all other lines.
pub(crate) fn core_s(line: &str) -> Option<f64> {
    let words: Vec<&str> = line.split(' ').collect();
    let &[
        "job",
        _,
        "ended",
        "after",
        seconds,
        "s",
        "with",
        cores,
        "cores",
    ] = words.as_slice()
    else {
        return None;
    };
    let (seconds, cores): (u64, u32) = (seconds.parse().ok()?, cores.parse().ok()?);
    Some(seconds as f64 * f64::from(cores))
}

/// Core seconds of all ended tasks.
fn used_core_s(logs: &Path) -> Result<f64, FolderError> {
    let entries = match fs::read_dir(logs) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(0.0),
        entries => entries.map_err(FolderError::at("read", logs))?,
    };
    let mut used = 0.0;
    for entry in entries {
        let path = entry.map_err(FolderError::at("read", logs))?.path();
        used += core_s_of(&path)?;
    }
    Ok(used)
}

fn core_s_of(log: &Path) -> Result<f64, FolderError> {
    let text = fs::read(log).map_err(FolderError::at("read", log))?;
    let text = String::from_utf8_lossy(&text);
    Ok(text.lines().filter_map(core_s).sum())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::histories::HistoryCost;
    use crate::submission::tests::{histories, submission, trainings};

    #[test]
    fn ended_tasks_are_counted_whoever_wrote_besides() {
        let folder = tempfile::tempdir().unwrap();
        let line = |task: &str, seconds: &str| {
            ended_line(2)
                .replace("$task", task)
                .replace("$SECONDS", seconds)
        };
        let log = format!("begun\n{}\n{}\n", line("1_1", "600"), line("1_1", "1200"));
        fs::write(folder.path().join("shard_1.log"), log).unwrap();
        let log = format!("\u{fffd}job 3 ended\n{}", line("3", "1800"));
        fs::write(folder.path().join("merge.log"), log).unwrap();
        assert_eq!(used_core_s(folder.path()).unwrap(), 2.0 * 3600.0);
        assert_eq!(used_core_s(&folder.path().join("none")).unwrap(), 0.0);
    }

    #[test]
    fn what_is_left_is_shared_by_the_tasks_that_run() {
        let mut submission = submission();
        let Work::Poses(work) = &mut submission.work else {
            panic!("poses")
        };
        work.poses = 100;
        work.cost.pose_cpu_s = 72.0;
        work.cost.limb_cpu_s = 36.0;
        work.bundle.shards = 10;
        submission.settings.cpus = 2;
        let logs = tempfile::tempdir().unwrap();
        let hours = |made, running| {
            let hours = CoreHours::of(&submission, made, &[], running, logs.path());
            hours.unwrap().estimate.unwrap()
        };
        let begun = hours((0, 0), 0);
        assert!((begun.estimated - 2.1).abs() < 1e-12 && begun.left == begun.estimated);
        assert_eq!(begun.left_hours, None);
        let half = hours((50, 5), 5);
        assert!((half.left - 1.05).abs() < 1e-12);
        assert!((half.left_hours.unwrap() - 0.105).abs() < 1e-12);
        assert_eq!(hours((100, 10), 0).left, 0.0);
    }

    #[test]
    fn histories_are_estimated_where_their_cost_was_measured() {
        let logs = tempfile::tempdir().unwrap();
        let mut submission = histories();
        let estimate = |submission: &Submission| {
            let hours = CoreHours::of(submission, (500, 1), &[], 1, logs.path());
            hours.unwrap().estimate
        };
        assert_eq!(estimate(&submission), None);
        let Work::Histories(work) = &mut submission.work else {
            panic!("histories")
        };
        work.cost = Some(HistoryCost {
            million_cpu_s: 3.6e6,
            preparation_cpu_s: 36.0,
        });
        let estimate = estimate(&submission).unwrap();
        assert!((estimate.estimated - 1.02).abs() < 1e-12);
        assert!((estimate.left - 0.51).abs() < 1e-12);
    }

    /// One of three training runs is finished; another was stopped after half an hour.
    #[test]
    fn trainings_are_estimated_from_those_that_are_finished() {
        let folder = tempfile::tempdir().unwrap();
        let logs = folder.path();
        let hours = |made, finished: &[&Path], running| {
            CoreHours::of(&trainings(), made, finished, running, logs).unwrap()
        };
        assert_eq!(
            serde_json::to_value(hours((0, 0), &[], 1)).unwrap(),
            serde_json::json!({"used": 0.0})
        );
        let line = |seconds: &str| ended_line(1).replace("$SECONDS", seconds);
        for (log, seconds) in [
            ("training_1", "3600"),
            ("training_2", "1800"),
            ("tables", "360"),
        ] {
            fs::write(logs.join(format!("{log}.log")), line(seconds)).unwrap();
        }
        let found = hours((1, 1), &[&logs.join("training_1.log")], 2);
        assert!((found.used - 1.6).abs() < 1e-12);
        let estimate = found.estimate.unwrap();
        assert!((estimate.estimated - 3.0).abs() < 1e-12, "{estimate:?}");
        assert!((estimate.left - 2.0).abs() < 1e-12, "{estimate:?}");
        let cores = 2.0 * f64::from(trainings().settings.cpus);
        assert_eq!(estimate.left_hours, Some(estimate.left / cores));
    }
}
