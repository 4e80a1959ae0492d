//! `slurm/submission.json`: how the work was divided into tasks, and their settings.

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use ppa_core::whole_file;
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize};
use sha2::{Digest, Sha256};

use crate::bundle::{Bundle, PoseCost};
use crate::error::FolderError;
use crate::histories::{self, HistoryWork};
use crate::time_limit::TimeLimit;

/// Version of the file format.
const VERSION: u32 = 1;

/// Slurm settings of every job.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TaskSettings {
    /// Partition; the cluster's default when absent.
    pub partition: Option<String>,
    /// Account; the user's default when absent.
    pub account: Option<String>,
    /// Wall-clock limit of a task.
    pub time: TimeLimit,
    /// Processors of a task.
    pub cpus: u32,
    /// Memory of a task as Slurm writes it, such as `4G`; the cluster's default when absent.
    pub mem: Option<String>,
    /// Generic resources of a task, such as `gpu:1`; none when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gres: Option<String>,
    /// Tasks that run at the same time; no limit when absent.
    pub max_tasks: Option<u64>,
    /// Shell commands that run before the work, such as `module load`.
    pub setup: Option<String>,
}

/// Source of the time of a pose.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CostSource {
    /// Measured on one pose.
    Measured,
    /// Given by the user.
    Given,
}

/// What the tasks make. Its division stays the same for all later submissions, since finished tasks follow it.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Work {
    /// Shards of a plan, one per task.
    Poses(PoseWork),
    /// Training runs of experiments, one per task.
    Trainings(TrainingWork),
    /// Parts of the histories of a command, one per task.
    Histories(HistoryWork),
}

impl<'de> Deserialize<'de> for Work {
    /// Not derived: serde would not say which key of an untagged variant is missing.
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let value = serde_json::Value::deserialize(deserializer)?;
        let has = |key| value.get(key).is_some();
        let work = match (has("experiments"), has("command")) {
            (true, _) => serde_json::from_value(value).map(Self::Trainings),
            (_, true) => serde_json::from_value(value).map(Self::Histories),
            _ => serde_json::from_value(value).map(Self::Poses),
        };
        work.map_err(D::Error::custom)
    }
}

/// The poses of a plan.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PoseWork {
    /// Poses of all limbs.
    pub poses: u64,
    /// Time of a pose and of a limb.
    pub cost: PoseCost,
    /// Source of these times.
    pub cost_source: CostSource,
    /// The division into shards.
    pub bundle: Bundle,
    /// Whether each shard, and the merged dataset, is one tar archive instead of a folder.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub archive: bool,
}

/// The training runs of experiments.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct TrainingWork {
    /// The experiments, in the order of the tasks.
    pub experiments: Vec<ExperimentTrainings>,
    /// Folders of other training runs that these start from or test.
    pub needed: Vec<String>,
}

/// The training runs of one experiment.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ExperimentTrainings {
    /// Name of the experiment, as `ppa experiment` takes it.
    pub experiment: String,
    /// The folder of each training run, relative to the folder of all runs. Task k of the experiment makes number k of them.
    pub trainings: Vec<String>,
}

impl PoseWork {
    /// File name ending of shards and dataset.
    pub(crate) fn ending(&self) -> &'static str {
        if self.archive { ".tar" } else { "" }
    }
}

impl Work {
    /// Name of the work of a task.
    pub fn task_name(&self) -> &'static str {
        match self {
            Self::Poses(_) => "shard",
            Self::Trainings(_) => "training",
            Self::Histories(_) => "part",
        }
    }

    /// Name of the last job.
    pub fn last_name(&self) -> &'static str {
        match self {
            Self::Poses(_) | Self::Histories(_) => "merge",
            Self::Trainings(_) => "tables",
        }
    }

    /// Number of tasks, which are counted from 1.
    pub fn tasks(&self) -> u64 {
        match self {
            Self::Poses(work) => work.bundle.shards,
            Self::Trainings(work) => work.trainings().count() as u64,
            Self::Histories(work) => work.parts,
        }
    }

    /// Interval between TERM and the time limit of a task, seconds: enough to finish the poses in progress, a step and its
    /// checkpoint, or a tally.
    pub fn warning_s(&self) -> u64 {
        match self {
            Self::Poses(work) => work.bundle.warning_s,
            Self::Trainings(_) => STEP_S,
            Self::Histories(_) => histories::WARNING_S,
        }
    }
}

/// Longer than a step, its checkpoint and Slurm's early warning, seconds.
const STEP_S: u64 = 180;

impl TrainingWork {
    /// The folders of the training runs, in the order of the tasks.
    pub fn trainings(&self) -> impl Iterator<Item = &str> {
        let all = self.experiments.iter();
        all.flat_map(|one| one.trainings.iter().map(String::as_str))
    }
}

/// Work as it was submitted.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Submission {
    version: u32,
    /// The plan file that was copied to the folder; for histories, the absolute path of the case or input file.
    pub plan: PathBuf,
    /// SHA-256 of that copy, or of the case or input file.
    pub plan_sha256: String,
    /// Poses, training runs or histories.
    #[serde(flatten)]
    pub work: Work,
    /// Slurm settings of the jobs.
    pub settings: TaskSettings,
    /// Whether jobs were queued, not only their scripts written; plan and division are then fixed.
    pub submitted: bool,
    /// SHA-256 of the scripts as written, by file name.
    pub scripts: BTreeMap<String, String>,
}

impl Submission {
    /// Creates the first submission of a plan, before any job is queued.
    pub fn new(plan: PathBuf, plan_sha256: String, work: Work, settings: TaskSettings) -> Self {
        Self {
            version: VERSION,
            plan,
            plan_sha256,
            work,
            settings,
            submitted: false,
            scripts: BTreeMap::new(),
        }
    }

    /// Reads the file; `None` if nothing was submitted.
    ///
    /// # Errors
    /// [`FolderError`] for a file that cannot be read or is not of this form.
    pub fn read(path: &Path) -> Result<Option<Self>, FolderError> {
        let text = match ppa_core::regular_file::read_to_string(path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            text => text.map_err(FolderError::at("read", path))?,
        };
        let unusable = |found: String| FolderError::Submission {
            path: path.to_owned(),
            found,
        };
        let read: Self =
            serde_json::from_str(&text).map_err(|error| unusable(error.to_string()))?;
        if read.version != VERSION {
            return Err(unusable(format!(
                "its version is {}, expected {VERSION}",
                read.version
            )));
        }
        match &read.work {
            Work::Poses(PoseWork { poses, bundle, .. })
                if !(1..=*poses).contains(&bundle.shards) =>
            {
                let shards = bundle.shards;
                Err(unusable(format!("it has {shards} shards of {poses} poses")))
            }
            Work::Trainings(work) if work.trainings().next().is_none() => {
                Err(unusable("it has no training runs".to_owned()))
            }
            Work::Histories(HistoryWork { divided, parts, .. })
                if !(1..=divided.histories).contains(parts) =>
            {
                let histories = divided.histories;
                Err(unusable(format!(
                    "it has {parts} parts of {histories} histories"
                )))
            }
            _ => Ok(Some(read)),
        }
    }

    /// Writes the file, whole or not at all.
    ///
    /// # Errors
    /// [`FolderError::File`].
    pub fn write(&self, path: &Path) -> Result<(), FolderError> {
        let text = serde_json::to_string_pretty(self).expect("text and numbers are JSON values");
        whole_file::write(path, (text + "\n").as_bytes()).map_err(FolderError::at("write", path))
    }

    /// Writes a script unless the existing one was edited by hand; returns true if an edited script was kept.
    ///
    /// # Errors
    /// [`FolderError::File`].
    pub fn write_script(&mut self, path: &Path, text: &str) -> Result<bool, FolderError> {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let held = match fs::read(path) {
            Ok(held) => Some(sha256(&held)),
            Err(error) if error.kind() == io::ErrorKind::NotFound => None,
            Err(error) => return Err(FolderError::at("read", path)(error)),
        };
        let written = sha256(text.as_bytes());
        let is_ours = |held: &String| self.scripts.get(&*name) == Some(held) || *held == written;
        if held.as_ref().is_some_and(|held| !is_ours(held)) {
            return Ok(true);
        }
        if held.as_ref() != Some(&written) {
            whole_file::write(path, text.as_bytes()).map_err(FolderError::at("write", path))?;
        }
        self.scripts.insert(name.into_owned(), written);
        Ok(false)
    }
}

fn sha256(bytes: &[u8]) -> String {
    let hash = Sha256::digest(bytes);
    hash.iter().map(|byte| format!("{byte:02x}")).collect()
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::histories::{DividedCommand, HistoryCommand};

    pub(crate) fn settings() -> TaskSettings {
        TaskSettings {
            partition: Some("main".to_owned()),
            account: None,
            time: TimeLimit::from_seconds(7200),
            cpus: 2,
            mem: Some("4G".to_owned()),
            gres: None,
            max_tasks: Some(3),
            setup: Some("module load ppa".to_owned()),
        }
    }

    /// Five poses in two shards.
    pub(crate) fn submission() -> Submission {
        let settings = settings();
        let cost = PoseCost {
            pose_cpu_s: 1200.0,
            limb_cpu_s: 0.1,
            resumes: false,
        };
        let bundle = crate::bundle(5, cost, 2, settings.time).unwrap();
        let work = Work::Poses(PoseWork {
            poses: 5,
            cost,
            cost_source: CostSource::Given,
            bundle,
            archive: false,
        });
        Submission::new("plan.toml".into(), "ab".repeat(32), work, settings)
    }

    /// Three training runs of two experiments, on a GPU.
    pub(crate) fn trainings() -> Submission {
        let experiment = |experiment: &str, trainings: &[&str]| ExperimentTrainings {
            experiment: experiment.to_owned(),
            trainings: trainings.iter().map(|&name| name.to_owned()).collect(),
        };
        let work = Work::Trainings(TrainingWork {
            experiments: vec![experiment("1", &["a", "b"]), experiment("2a", &["c"])],
            needed: vec!["p".to_owned()],
        });
        let settings = TaskSettings {
            gres: Some("gpu:1".to_owned()),
            ..settings()
        };
        Submission::new("experiments.toml".into(), "cd".repeat(32), work, settings)
    }

    /// A radiograph in two parts.
    pub(crate) fn histories() -> Submission {
        let words = |words: &str| words.split(' ').map(str::to_owned).collect();
        let work = Work::Histories(HistoryWork {
            divided: DividedCommand {
                command: HistoryCommand::Simulate,
                words: words("xray simulate leg.toml --engine analog"),
                outputs: words("--out leg.png"),
                folder: "/home/a b".into(),
                histories: 1000,
                projections: 1,
                program_sha256: "ab".repeat(32),
            },
            parts: 2,
            cost: None,
        });
        Submission::new(
            "/home/a b/leg.toml".into(),
            "ef".repeat(32),
            work,
            settings(),
        )
    }

    #[test]
    fn a_submission_is_read_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("submission.json");
        assert_eq!(Submission::read(&path).unwrap(), None);
        trainings().write(&path).unwrap();
        assert_eq!(Submission::read(&path).unwrap(), Some(trainings()));
        histories().write(&path).unwrap();
        assert_eq!(Submission::read(&path).unwrap(), Some(histories()));
        submission().write(&path).unwrap();
        assert_eq!(Submission::read(&path).unwrap(), Some(submission()));
        let text = fs::read_to_string(&path).unwrap();
        for (from, to, words) in [
            ("\"version\": 1", "\"version\": 2", "version is 2"),
            ("\"poses\": 5", "\"poses\": 0", "of 0 poses"),
            ("\"bundle\"", "\"bundled\"", "missing field `bundle`"),
            ("{", "", "damaged"),
        ] {
            fs::write(&path, text.replacen(from, to, 1)).unwrap();
            let said = Submission::read(&path).unwrap_err().to_string();
            assert!(said.contains(words), "{said}");
        }
    }

    #[test]
    fn an_edited_script_is_kept() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("shard.sh");
        let mut submission = submission();
        assert!(!submission.write_script(&path, "one").unwrap());
        assert!(!submission.write_script(&path, "two").unwrap());
        assert_eq!(fs::read_to_string(&path).unwrap(), "two");
        fs::write(&path, "edited").unwrap();
        assert!(submission.write_script(&path, "three").unwrap());
        assert_eq!(fs::read_to_string(&path).unwrap(), "edited");
    }
}
