//! The training runs below a folder: their progress and the contents of their logs.

use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, SystemTime};

use ppa_dataset::files::FileError;
use ppa_dataset::manifest::DESCRIPTION_FILE;
use ppa_learn::train::{LogRow, TrainConfig, read_log};
use serde::Serialize;

use crate::commands::of_training;
use crate::error::StudioError;

/// Configuration file of every training run.
pub(crate) const CONFIG_FILE: &str = "config.toml";
const LOG_FILE: &str = "log.jsonl";
const WEIGHTS_FILE: &str = "weights.safetensors";

/// Maximum depth of the search: the runs of an experiment are in folders for experiment, column, fold, camera and seed.
const DEEPEST: usize = 6;

/// Maximum number of log rows that are sent; longer logs are reduced to means of successive rows.
const MOST_ROWS: usize = 1000;

/// Search for training runs.
pub(crate) struct Trainings {
    /// Folder that the names of runs are relative to.
    base: PathBuf,
    /// A training run, or a folder of them.
    start: PathBuf,
    depth: usize,
    /// Cache of logs.
    known: Mutex<HashMap<PathBuf, KnownLog>>,
    /// Cache of folders.
    folders: Mutex<HashMap<PathBuf, KnownFolder>>,
}

/// Contents of a folder at its last modification time.
struct KnownFolder {
    changed: SystemTime,
    holds: Held,
}

/// Kind of a folder in the search.
#[derive(Clone)]
enum Held {
    Training,
    /// A dataset, which holds no training runs.
    Dataset,
    Folders(Vec<PathBuf>),
}

/// Contents of a log at a given length.
#[derive(Clone)]
struct KnownLog {
    bytes: u64,
    step: u64,
    rows: usize,
    last: BTreeMap<String, f64>,
}

/// State of a training run according to its files.
#[derive(Debug, Serialize)]
pub(crate) struct TrainingState {
    pub name: String,
    /// Step of the last row of its log.
    pub step: u64,
    /// Number of rows of its log.
    pub rows: usize,
    /// Total number of steps.
    pub steps: u64,
    /// Whether its weights exist.
    pub finished: bool,
    /// Seconds since its log was last written.
    pub silent_s: Option<f64>,
    /// The last value of each scalar.
    pub last: BTreeMap<String, f64>,
    /// Command that evaluates it, if it is finished.
    pub command: Option<String>,
    /// Why its configuration or its log cannot be read.
    pub error: Option<String>,
}

impl Trainings {
    /// Returns a search for a training run, or for those below a folder.
    pub fn below(start: &Path) -> Self {
        let is_training = is_training(start);
        let base = start.parent().filter(|_| is_training).unwrap_or(start);
        Self {
            base: base.to_owned(),
            start: start.to_owned(),
            depth: DEEPEST,
            known: Mutex::default(),
            folders: Mutex::default(),
        }
    }

    /// Returns a search of the folder that contains `path`.
    pub fn beside(path: &Path) -> Self {
        let parent = path.parent().filter(|it| !it.as_os_str().is_empty());
        let folder = parent.unwrap_or(Path::new("."));
        Self {
            base: folder.to_owned(),
            start: folder.to_owned(),
            depth: 1,
            known: Mutex::default(),
            folders: Mutex::default(),
        }
    }

    /// Returns the searched folder.
    pub fn start(&self) -> &Path {
        &self.start
    }

    /// Returns the states of all training runs, sorted by name.
    pub fn states(&self) -> Result<Vec<TrainingState>, StudioError> {
        Ok(self.folders()?.iter().map(|run| self.state(run)).collect())
    }

    /// Whether there are no training runs.
    pub fn is_empty(&self) -> Result<bool, StudioError> {
        Ok(self.folders()?.is_empty())
    }

    /// Returns the folder of a training run.
    ///
    /// # Errors
    /// [`StudioError::Invalid`] unless `name` is a training run below the searched folder.
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

    /// Returns the log rows of a training run, or means of successive rows.
    pub fn log(&self, name: &str) -> Result<Vec<LogRow>, StudioError> {
        let rows = read_log(&self.folder(name)?.join(LOG_FILE))?;
        let together = rows.len().div_ceil(MOST_ROWS).max(1);
        Ok(rows.chunks(together).map(mean).collect())
    }

    /// Returns the folders of all training runs. Folders whose entries have not changed since the last search are not read again.
    fn folders(&self) -> Result<Vec<PathBuf>, StudioError> {
        let mut known = self.folders.lock().unwrap_or_else(PoisonError::into_inner);
        let mut search = Search {
            before: std::mem::take(&mut *known),
            now: HashMap::new(),
            found: Vec::new(),
        };
        let searched = search.below(&self.start, self.depth);
        *known = search.now;
        searched.map_err(FileError::at("read", &self.start))?;
        search.found.sort();
        Ok(search.found)
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

    /// Returns the contents of a log, which is read again only if its length has changed.
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

/// Whether a folder is that of a training run.
pub(crate) fn is_training(folder: &Path) -> bool {
    folder.join(CONFIG_FILE).exists() && folder.join(LOG_FILE).exists()
}

/// Age below which a changed folder is read again: another change may leave the same modification time.
const SETTLED: Duration = Duration::from_secs(2);

/// A search for training runs, with the folders known from the previous one.
struct Search {
    before: HashMap<PathBuf, KnownFolder>,
    now: HashMap<PathBuf, KnownFolder>,
    found: Vec<PathBuf>,
}

impl Search {
    /// Adds a training run, or those at most `depth` folders below; does not search below a training run or a dataset.
    fn below(&mut self, folder: &Path, depth: usize) -> std::io::Result<()> {
        match self.held(folder)? {
            Held::Training => self.found.push(folder.to_owned()),
            Held::Folders(below) if depth > 0 => {
                for folder in below {
                    // A folder that cannot be read, or was removed, holds no training run to show.
                    let _ = self.below(&folder, depth - 1);
                }
            }
            Held::Dataset | Held::Folders(_) => {}
        }
        Ok(())
    }

    fn held(&mut self, folder: &Path) -> std::io::Result<Held> {
        let changed = std::fs::metadata(folder)?.modified()?;
        let same = |known: &KnownFolder| known.changed == changed;
        let holds = match self.before.remove(folder).filter(same) {
            Some(known) => known.holds,
            None => held(folder)?,
        };
        let ago = SystemTime::now().duration_since(changed);
        if ago.is_ok_and(|ago| ago > SETTLED) {
            let holds = holds.clone();
            self.now
                .insert(folder.to_owned(), KnownFolder { changed, holds });
        }
        Ok(holds)
    }
}

fn held(folder: &Path) -> std::io::Result<Held> {
    if is_training(folder) {
        return Ok(Held::Training);
    }
    if folder.join(DESCRIPTION_FILE).exists() {
        return Ok(Held::Dataset);
    }
    let mut below = Vec::new();
    for entry in std::fs::read_dir(folder)? {
        let entry = entry?;
        if entry.file_type()?.is_dir() {
            below.push(entry.path());
        }
    }
    Ok(Held::Folders(below))
}

fn silent_s(log: &Path) -> Option<f64> {
    let written = std::fs::metadata(log).ok()?.modified().ok()?;
    // The clock of a file server may be ahead.
    let silent = SystemTime::now().duration_since(written);
    Some(silent.unwrap_or_default().as_secs_f64())
}

/// Averages successive rows: returns their last step and the mean of each scalar over the rows that have it.
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
    fn trainings_that_come_and_go_are_found_at_the_next_search() {
        let root = tempfile::tempdir().unwrap();
        let at = |name: &str| root.path().join(name);
        // Sets an old modification time, so that the search caches the folders.
        let age = |name: &str| {
            let folder = std::fs::File::open(at(name)).unwrap();
            let long_ago = SystemTime::now() - Duration::from_secs(100);
            folder.set_modified(long_ago).unwrap();
        };
        training(&at("group/a"), "");
        for folder in ["", "group", "group/a"] {
            age(folder);
        }
        let trainings = Trainings::below(root.path());
        assert_eq!(names(&trainings), ["group/a"]);
        assert_eq!(trainings.folders.lock().unwrap().len(), 3);
        assert_eq!(names(&trainings), ["group/a"]);
        training(&at("group/b"), "");
        assert_eq!(names(&trainings), ["group/a", "group/b"]);
        std::fs::remove_file(at("group/a").join(LOG_FILE)).unwrap();
        assert_eq!(names(&trainings), ["group/b"]);
        // An older folder is not read again: this one became a training run without a change of its time.
        std::fs::create_dir(at("late")).unwrap();
        age("late");
        assert_eq!(names(&trainings), ["group/b"]);
        training(&at("late"), "");
        age("late");
        let changed = std::fs::metadata(at("late")).unwrap().modified().unwrap();
        trainings
            .folders
            .lock()
            .unwrap()
            .get_mut(&at("late"))
            .unwrap()
            .changed = changed;
        assert_eq!(names(&trainings), ["group/b"]);
        training(&at("late/below"), "");
        std::fs::remove_dir_all(at("late/below")).unwrap();
        assert_eq!(names(&trainings), ["group/b", "late"]);
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
        // For steps 998 to 1000, the mean ignores rows without an evaluation.
        assert_eq!(rows[333].scalars["evaluation/mae"], 0.5);
        let state = &trainings.states().unwrap()[0];
        assert_eq!((state.step, state.finished), (3000, false));
        assert_eq!(state.last["training/loss"], 2999.0);
        assert!(state.silent_s.unwrap() < 3600.0);
    }
}
