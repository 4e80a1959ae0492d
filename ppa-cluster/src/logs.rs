//! Task logs: one file per task, to which every attempt appends.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use crate::error::FolderError;
use crate::submission::Work;
use crate::usage::core_s;

/// Bytes read from the end of a log.
const TAIL: u64 = 16 * 1024;

/// File name of the logs of one array chunk, for `sbatch --output`; Slurm replaces `%a` by the index.
pub(crate) fn log_pattern(work: &Work, offset: u64) -> String {
    let name = work.task_name();
    match offset {
        0 => format!("{name}_%a.log"),
        offset => format!("{name}_{offset}+%a.log"),
    }
}

/// The task number in a log's name.
fn task_of(name: &str) -> Option<u64> {
    let number = name
        .strip_prefix("shard_")
        .or(name.strip_prefix("training_"))
        .or(name.strip_prefix("part_"))?;
    let number = number.strip_suffix(".log")?;
    let (offset, index) = number.split_once('+').unwrap_or(("0", number));
    let (offset, index): (u64, u64) = (offset.parse().ok()?, index.parse().ok()?);
    offset.checked_add(index)
}

/// Returns the newest log of every started task, by task number. A missing folder has none.
///
/// # Errors
/// [`FolderError::File`] when the folder cannot be read.
pub fn logged_tasks(logs: &Path) -> Result<BTreeMap<u64, PathBuf>, FolderError> {
    let failed = |error| FolderError::at("read", logs)(error);
    let entries = match fs::read_dir(logs) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(BTreeMap::new()),
        entries => entries.map_err(failed)?,
    };
    let mut newest = BTreeMap::new();
    for entry in entries {
        let entry = entry.map_err(failed)?;
        let Some(task) = entry.file_name().to_str().and_then(task_of) else {
            continue;
        };
        let written = entry.metadata().and_then(|found| found.modified()).ok();
        let log = (written, entry.path());
        let known = newest.entry(task).or_insert_with(|| log.clone());
        if known.0 < written {
            *known = log;
        }
    }
    let paths = newest.into_iter().map(|(task, (_, path))| (task, path));
    Ok(paths.collect())
}

/// Returns the last line of a log that is neither empty nor the closing line of a task; `None` if there is none.
pub fn last_line(log: &Path) -> Option<String> {
    let mut file = File::open(log).ok()?;
    let size = file.metadata().ok()?.len();
    file.seek(SeekFrom::Start(size.saturating_sub(TAIL))).ok()?;
    let mut tail = Vec::new();
    file.take(TAIL).read_to_end(&mut tail).ok()?;
    let text = String::from_utf8_lossy(&tail);
    let mut lines = text.lines().map(str::trim).rev();
    let says_why = |line: &&str| !line.is_empty() && core_s(line).is_none();
    lines.find(says_why).map(str::to_owned)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::submission::tests::{submission, trainings};

    #[test]
    fn logs_are_found_by_task_in_every_chunk() {
        let folder = tempfile::tempdir().unwrap();
        let logs = folder.path().join("logs");
        assert!(logged_tasks(&logs).unwrap().is_empty());
        fs::create_dir(&logs).unwrap();
        for name in [
            log_pattern(&submission().work, 0).replace("%a", "7"),
            log_pattern(&submission().work, 1000).replace("%a", "7"),
            log_pattern(&trainings().work, 0).replace("%a", "9"),
            "merge.log".to_owned(),
            "shard_x.log".to_owned(),
        ] {
            fs::write(logs.join(name), "begun\nlast\n\n").unwrap();
        }
        let found = logged_tasks(&logs).unwrap();
        assert_eq!(found.keys().collect::<Vec<_>>(), [&7, &9, &1007]);
        assert_eq!(last_line(&found[&1007]).unwrap(), "last");
    }

    #[test]
    fn the_last_line_of_a_long_log_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let log = folder.path().join("log");
        fs::write(&log, format!("{}\nthe end\n", "é".repeat(20_000))).unwrap();
        assert_eq!(last_line(&log).unwrap(), "the end");
        fs::write(&log, "the cause\njob 7_1 ended after 35 s with 2 cores\n").unwrap();
        assert_eq!(last_line(&log).unwrap(), "the cause");
        fs::write(&log, "\n \n").unwrap();
        assert_eq!(last_line(&log), None);
        assert_eq!(last_line(&folder.path().join("none")), None);
    }
}
