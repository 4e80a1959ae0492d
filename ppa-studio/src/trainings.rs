//! The trainings below a folder: how far they are, and what their logs hold.

use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::SystemTime;

use ppa_dataset::files::FileError;
use ppa_dataset::manifest::DESCRIPTION_FILE;
use ppa_learn::train::{LogRow, TrainConfig, read_log};
use serde::Serialize;

use crate::commands::of_training;
use crate::error::StudioError;

/// File that every training has.
pub(crate) const CONFIG_FILE: &str = "config.toml";
const LOG_FILE: &str = "log.jsonl";
const WEIGHTS_FILE: &str = "weights.safetensors";

/// How deep trainings are looked for: those of an experiment lie in experiment, column, fold, camera and seed.
const DEEPEST: usize = 6;

/// Most rows of a log that are sent; of longer ones, means of successive rows.
const MOST_ROWS: usize = 1000;

/// Where trainings are looked for.
pub(crate) struct Trainings {
    /// Their names are paths from here.
    base: PathBuf,
    /// A training, or a folder of them.
    start: PathBuf,
    depth: usize,
    /// What was read of logs that have not changed since.
    known: Mutex<HashMap<PathBuf, KnownLog>>,
}

/// What a log of some length held.
#[derive(Clone)]
struct KnownLog {
    bytes: u64,
    step: u64,
    rows: usize,
    last: BTreeMap<String, f64>,
}

/// A training as its files show it.
#[derive(Debug, Serialize)]
pub(crate) struct TrainingState {
    pub name: String,
    /// Steps of the last row of its log.
    pub step: u64,
    /// Rows of its log.
    pub rows: usize,
    /// Steps in all.
    pub steps: u64,
    /// Whether its weights are there.
    pub finished: bool,
    /// Seconds since its log was written last.
    pub silent_s: Option<f64>,
    /// The last value of each scalar.
    pub last: BTreeMap<String, f64>,
    /// The command that evaluates it, if it is finished.
    pub command: Option<String>,
    /// Why its configuration or its log cannot be read.
    pub error: Option<String>,
}

impl Trainings {
    /// A training, or those below a folder.
    pub fn below(start: &Path) -> Self {
        let is_training = is_training(start);
        let base = start.parent().filter(|_| is_training).unwrap_or(start);
        Self {
            base: base.to_owned(),
            start: start.to_owned(),
            depth: DEEPEST,
            known: Mutex::default(),
        }
    }

    /// Those in the folder of a file or folder.
    pub fn beside(path: &Path) -> Self {
        let parent = path.parent().filter(|it| !it.as_os_str().is_empty());
        let folder = parent.unwrap_or(Path::new("."));
        Self {
            base: folder.to_owned(),
            start: folder.to_owned(),
            depth: 1,
            known: Mutex::default(),
        }
    }

    /// Folder that is searched.
    pub fn start(&self) -> &Path {
        &self.start
    }

    /// All trainings, by name.
    pub fn states(&self) -> Result<Vec<TrainingState>, StudioError> {
        Ok(self.folders()?.iter().map(|run| self.state(run)).collect())
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> Result<bool, StudioError> {
        Ok(self.folders()?.is_empty())
    }

    /// The folder of a training.
    ///
    /// # Errors
    /// [`StudioError::Invalid`] for anything but a training below the folder that is searched.
    pub fn folder(&self, name: &str) -> Result<PathBuf, StudioError> {
        let run = self.base.join(name);
        let is_below = match (self.base.canonicalize(), run.canonicalize()) {
            (Ok(base), Ok(run)) => run.starts_with(base),
            _ => false,
        };
        if is_below && is_training(&run) {
            return Ok(run);
        }
        Err(StudioError::Invalid(format!("no training is named {name}")))
    }

    /// The rows of a training's log, or means of successive ones.
    pub fn log(&self, name: &str) -> Result<Vec<LogRow>, StudioError> {
        let rows = read_log(&self.folder(name)?.join(LOG_FILE))?;
        let together = rows.len().div_ceil(MOST_ROWS).max(1);
        Ok(rows.chunks(together).map(mean).collect())
    }

    fn folders(&self) -> Result<Vec<PathBuf>, StudioError> {
        let mut found = Vec::new();
        search(&self.start, self.depth, &mut found).map_err(FileError::at("read", &self.start))?;
        found.sort();
        Ok(found)
    }

    fn name(&self, run: &Path) -> String {
        let name = run.strip_prefix(&self.base).unwrap_or(run);
        name.to_string_lossy().into_owned()
    }

    fn state(&self, run: &Path) -> TrainingState {
        let log_file = run.join(LOG_FILE);
        let mut state = TrainingState {
            name: self.name(run),
            step: 0,
            rows: 0,
            steps: 0,
            finished: run.join(WEIGHTS_FILE).exists(),
            silent_s: silent_s(&log_file),
            last: BTreeMap::new(),
            command: None,
            error: None,
        };
        state.command = state.finished.then(|| of_training(run));
        match TrainConfig::read_run(run) {
            Ok(config) => state.steps = config.schedule().steps(),
            Err(error) => state.error = Some(ppa_core::text::error_chain(&error)),
        }
        match self.known_log(&log_file) {
            Ok(log) => {
                (state.step, state.rows, state.last) = (log.step, log.rows, log.last);
            }
            Err(error) => state.error = Some(ppa_core::text::error_chain(&error)),
        }
        state
    }

    /// What a log holds, which is read again only when its length has changed.
    fn known_log(&self, file: &Path) -> Result<KnownLog, FileError> {
        let bytes = std::fs::metadata(file).map_or(0, |metadata| metadata.len());
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(log) = known.get(file).filter(|log| log.bytes == bytes) {
            return Ok(log.clone());
        }
        let rows = read_log(file)?;
        let log = KnownLog {
            bytes,
            step: rows.last().map_or(0, |row| row.step),
            rows: rows.len(),
            last: rows.into_iter().flat_map(|row| row.scalars).collect(),
        };
        known.insert(file.to_owned(), log.clone());
        Ok(log)
    }
}

/// Whether a folder is that of a training.
pub(crate) fn is_training(folder: &Path) -> bool {
    folder.join(CONFIG_FILE).exists() && folder.join(LOG_FILE).exists()
}

/// Adds a training, or those at most `depth` folders below; what is below a training or a dataset is not looked at.
fn search(folder: &Path, depth: usize, found: &mut Vec<PathBuf>) -> std::io::Result<()> {
    if is_training(folder) {
        found.push(folder.to_owned());
        return Ok(());
    }
    if depth == 0 || folder.join(DESCRIPTION_FILE).exists() {
        return Ok(());
    }
    for entry in std::fs::read_dir(folder)? {
        let entry = entry?;
        if entry.file_type()?.is_dir() {
            // A folder that cannot be read, or is gone again, holds no training to show.
            let _ = search(&entry.path(), depth - 1, found);
        }
    }
    Ok(())
}

fn silent_s(log: &Path) -> Option<f64> {
    let written = std::fs::metadata(log).ok()?.modified().ok()?;
    // The clock of a file server may be ahead.
    let silent = SystemTime::now().duration_since(written);
    Some(silent.unwrap_or_default().as_secs_f64())
}

/// One row for several successive ones: their last step, and the mean of each scalar over the rows that have it.
fn mean(rows: &[LogRow]) -> LogRow {
    let mut sums: BTreeMap<&String, (f64, f64)> = BTreeMap::new();
    for (tag, value) in rows.iter().flat_map(|row| &row.scalars) {
        let (sum, count) = sums.entry(tag).or_default();
        *sum += value;
        *count += 1.0;
    }
    let last = &rows[rows.len() - 1];
    LogRow {
        step: last.step,
        seconds: last.seconds,
        scalars: sums
            .into_iter()
            .map(|(tag, (sum, count))| (tag.clone(), sum / count))
            .collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn training(folder: &Path, log: &str) {
        std::fs::create_dir_all(folder).unwrap();
        std::fs::write(folder.join(CONFIG_FILE), "preset = \"quick\"\n").unwrap();
        std::fs::write(folder.join(LOG_FILE), log).unwrap();
    }

    fn names(trainings: &Trainings) -> Vec<String> {
        let states = trainings.states().unwrap();
        states.into_iter().map(|state| state.name).collect()
    }

    #[test]
    fn trainings_below_a_folder_are_found_by_their_files() {
        let root = tempfile::tempdir().unwrap();
        let at = |name: &str| root.path().join(name);
        training(&at("b"), "");
        training(&at("a/fold-1/left"), "");
        training(&at("b/inside"), "");
        training(&at("data/run"), "");
        std::fs::write(at("data").join(DESCRIPTION_FILE), "{}").unwrap();
        training(&at("1/2/3/4/5/6/too-deep"), "");
        std::fs::create_dir(at("empty")).unwrap();
        assert_eq!(
            names(&Trainings::below(root.path())),
            ["a/fold-1/left", "b"]
        );
        assert_eq!(names(&Trainings::below(&at("b"))), ["b"]);
        assert_eq!(names(&Trainings::beside(&at("plan.toml"))), ["b"]);
        let below = Trainings::below(root.path());
        assert_eq!(below.folder("b").unwrap(), at("b"));
        for name in ["..", "", "1", "data", "/etc"] {
            assert!(below.folder(name).is_err(), "{name}");
        }
    }

    #[test]
    fn a_long_log_is_sent_as_means_of_its_rows() {
        let root = tempfile::tempdir().unwrap();
        let row = |step: usize| match step % 1000 {
            0 => format!(r#"{{"step":{step},"seconds":1.0,"evaluation/mae":0.5}}"#),
            _ => format!(r#"{{"step":{step},"seconds":1.0,"training/loss":{step}.0}}"#),
        };
        let lines = (1..=3000).map(|step| row(step) + "\n");
        training(&root.path().join("run"), &lines.collect::<String>());
        let trainings = Trainings::below(root.path());
        let rows = trainings.log("run").unwrap();
        assert_eq!(rows.len(), 1000);
        assert_eq!(rows[0].step, 3);
        assert_eq!(rows[0].scalars["training/loss"], 2.0);
        // Of steps 998 to 1000, the evaluation is not diluted by rows without one.
        assert_eq!(rows[333].scalars["evaluation/mae"], 0.5);
        let state = &trainings.states().unwrap()[0];
        assert_eq!((state.step, state.finished), (3000, false));
        assert_eq!(state.last["training/loss"], 2999.0);
        assert!(state.silent_s.unwrap() < 3600.0);
    }
}
