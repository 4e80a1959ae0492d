//! `slurm/submission.json`: how a plan was divided, and the settings of its jobs.

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use ppa_core::whole_file;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::bundle::{Bundle, PoseCost};
use crate::error::FolderError;
use crate::time_limit::TimeLimit;

/// Format of the file.
const VERSION: u32 = 1;

/// What every job asks Slurm for.
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
    /// Tasks that run at the same time; no limit when absent.
    pub max_tasks: Option<u64>,
    /// Shell commands that run before the work, such as `module load`.
    pub setup: Option<String>,
}

/// Where the time of a pose comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CostSource {
    /// One pose was made to measure it.
    Measured,
    /// The user stated it.
    Given,
}

/// A plan as it was submitted. Its division stays the same for all later submissions, since shards that are made follow it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Submission {
    version: u32,
    /// The plan file that the copy in the folder was made from.
    pub plan: PathBuf,
    /// SHA-256 of that copy.
    pub plan_sha256: String,
    /// Poses of all limbs.
    pub poses: u64,
    /// Time of a pose and of a limb.
    pub cost: PoseCost,
    /// Where these times come from.
    pub cost_source: CostSource,
    /// The division into shards.
    pub bundle: Bundle,
    /// What the jobs ask for.
    pub settings: TaskSettings,
    /// Whether jobs were queued, and not only their scripts written: from then on plan and division stay.
    pub submitted: bool,
    /// SHA-256 of the scripts as they were written, by file name.
    pub scripts: BTreeMap<String, String>,
}

impl Submission {
    /// The first submission of a plan, before any job is queued.
    pub fn new(
        plan: PathBuf,
        plan_sha256: String,
        poses: u64,
        cost: (PoseCost, CostSource),
        bundle: Bundle,
        settings: TaskSettings,
    ) -> Self {
        Self {
            version: VERSION,
            plan,
            plan_sha256,
            poses,
            cost: cost.0,
            cost_source: cost.1,
            bundle,
            settings,
            submitted: false,
            scripts: BTreeMap::new(),
        }
    }

    /// Reads the file; `None` where nothing was submitted.
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
        if !(1..=read.poses).contains(&read.bundle.shards) {
            return Err(unusable(format!(
                "it has {} shards of {} poses",
                read.bundle.shards, read.poses
            )));
        }
        Ok(Some(read))
    }

    /// Writes the file, whole or not at all.
    ///
    /// # Errors
    /// [`FolderError::File`].
    pub fn write(&self, path: &Path) -> Result<(), FolderError> {
        let text = serde_json::to_string_pretty(self).expect("text and numbers are JSON values");
        whole_file::write(path, (text + "\n").as_bytes()).map_err(FolderError::at("write", path))
    }

    /// Writes a script, unless somebody edited the one that is there: an edited script is kept, and true returned.
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

    pub(crate) fn submission() -> Submission {
        let settings = TaskSettings {
            partition: Some("main".to_owned()),
            account: None,
            time: TimeLimit::from_seconds(7200),
            cpus: 2,
            mem: Some("4G".to_owned()),
            max_tasks: Some(3),
            setup: Some("module load ppa".to_owned()),
        };
        let cost = PoseCost {
            pose_cpu_s: 1200.0,
            limb_cpu_s: 0.1,
        };
        let bundle = crate::bundle(5, cost, 2, settings.time).unwrap();
        let cost = (cost, CostSource::Given);
        Submission::new(
            "plan.toml".into(),
            "ab".repeat(32),
            5,
            cost,
            bundle,
            settings,
        )
    }

    #[test]
    fn a_submission_is_read_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("submission.json");
        assert_eq!(Submission::read(&path).unwrap(), None);
        submission().write(&path).unwrap();
        assert_eq!(Submission::read(&path).unwrap(), Some(submission()));
        let text = fs::read_to_string(&path).unwrap();
        for (from, to, words) in [
            ("\"version\": 1", "\"version\": 2", "version is 2"),
            ("\"poses\": 5", "\"poses\": 0", "of 0 poses"),
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
