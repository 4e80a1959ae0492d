//! Pairs of frames in a folder that a recorder fills.

use std::collections::HashMap;
use std::fs;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime};

use ppa_dataset::FileError;
use ppa_dataset::layout::View;

/// Bytes of the last chunk of every PNG: zero length, its name, its checksum.
const PNG_END: [u8; 12] = *b"\0\0\0\0IEND\xaeB`\x82";
/// Time after which a file that has not grown is considered final.
const SETTLED: Duration = Duration::from_secs(1);

/// Two frames of one moment.
#[derive(Debug, Clone, PartialEq)]
pub struct FramePair {
    /// Common part of their names, such as `45.0` or `12_1700000000`.
    pub name: String,
    /// The left and the right camera's file.
    pub files: [PathBuf; 2],
    /// Time at which both were found complete.
    pub found: Instant,
}

/// A folder whose files `depth_cam_left_NAME.png` and `depth_cam_right_NAME.png` make pairs.
#[derive(Debug)]
pub struct PairFolder {
    path: PathBuf,
    /// Names of pairs that were returned, and whether the last look found one of their files.
    taken: HashMap<String, bool>,
    /// Incomplete files, with their length and the time since which it has not changed.
    growing: HashMap<PathBuf, (u64, Instant)>,
    alone: usize,
}

impl PairFolder {
    /// Watches a folder from which no pair has been returned yet.
    pub fn new(path: &Path) -> Self {
        Self {
            path: path.to_owned(),
            taken: HashMap::new(),
            growing: HashMap::new(),
            alone: 0,
        }
    }

    /// Returns the pairs that have become complete since the last look, in the order in which they were written.
    ///
    /// A file is complete when it ends with the last chunk of a PNG. An incomplete file that has not grown for a second is
    /// returned as well, so that its reader reports the error. A pair is returned once as long as one of its files exists;
    /// files of the same name that appear after a look without any are a new pair.
    ///
    /// # Errors
    /// [`FileError`] if the folder cannot be read.
    pub fn look(&mut self) -> Result<Vec<FramePair>, FileError> {
        let unreadable = |source| FileError {
            action: "read",
            path: self.path.clone(),
            source,
        };
        self.taken.values_mut().for_each(|there| *there = false);
        let mut halves: HashMap<String, [Option<PathBuf>; 2]> = HashMap::new();
        for entry in fs::read_dir(&self.path).map_err(unreadable)? {
            let entry = entry.map_err(unreadable)?;
            let file = entry.file_name();
            let Some((view, name)) = file.to_str().and_then(view_and_name) else {
                continue;
            };
            match self.taken.get_mut(name) {
                Some(there) => *there = true,
                None => {
                    let half = &mut halves.entry(name.to_owned()).or_default()[view as usize];
                    *half = Some(entry.path());
                }
            }
        }
        self.taken.retain(|_, there| *there);
        // Files that are not seen again are forgotten.
        let before = std::mem::take(&mut self.growing);
        let mut pairs = Vec::new();
        self.alone = 0;
        for (name, halves) in halves {
            let [Some(left), Some(right)] = halves else {
                self.alone += 1;
                continue;
            };
            // Always checks both, so that both clocks run.
            let whole = [self.written(&left, &before), self.written(&right, &before)];
            if let [Some(first), Some(second)] = whole {
                self.taken.insert(name.clone(), true);
                let files = [left, right];
                files.iter().for_each(|file| {
                    self.growing.remove(file);
                });
                let found = Instant::now();
                pairs.push((first.max(second), FramePair { name, files, found }));
            }
        }
        pairs.sort_by(|a, b| (a.0, &a.1.name).cmp(&(b.0, &b.1.name)));
        Ok(pairs.into_iter().map(|(_, pair)| pair).collect())
    }

    /// Returns the number of names with only one camera's file at the last look.
    pub fn alone(&self) -> usize {
        self.alone
    }

    /// Returns when a file was written, if it is complete or will not become so; `None` for a file that has disappeared.
    fn written(
        &mut self,
        file: &Path,
        before: &HashMap<PathBuf, (u64, Instant)>,
    ) -> Option<SystemTime> {
        let (length, written, whole) = end_of(file).ok()?;
        let now = Instant::now();
        let since = match before.get(file) {
            Some(&(same, since)) if same == length => since,
            _ => now,
        };
        self.growing.insert(file.to_owned(), (length, since));
        (whole || now.duration_since(since) >= SETTLED).then_some(written)
    }
}

/// Returns the length of a file, when it was written, and whether it ends as a PNG.
fn end_of(file: &Path) -> io::Result<(u64, SystemTime, bool)> {
    let mut file = ppa_core::regular_file::open(file)?;
    let metadata = file.metadata()?;
    let mut end = [0; PNG_END.len()];
    if metadata.len() >= end.len() as u64 {
        file.seek(SeekFrom::End(-(end.len() as i64)))?;
        file.read_exact(&mut end)?;
    }
    Ok((metadata.len(), metadata.modified()?, end == PNG_END))
}

/// Returns camera and common name of `depth_cam_left_NAME.png`.
fn view_and_name(file: &str) -> Option<(View, &str)> {
    let rest = file.strip_prefix("depth_")?.strip_suffix(".png")?;
    View::ALL
        .into_iter()
        .find_map(|view| Some((view, rest.strip_prefix(view.name())?.strip_prefix('_')?)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &mut PairFolder) -> Vec<String> {
        let pairs = folder.look().unwrap();
        pairs.into_iter().map(|pair| pair.name).collect()
    }

    #[test]
    fn pairs_come_once_when_both_files_are_whole() {
        let root = tempfile::tempdir().unwrap();
        let put = |name: &str, end: &[u8]| {
            fs::write(root.path().join(name), [b"any", end].concat()).unwrap();
        };
        let mut folder = PairFolder::new(root.path());
        put("depth_cam_left_45.0.png", &PNG_END);
        put("depth_cam_left_orig_1_17.png", &PNG_END);
        put("depth_cam_middle_1.png", &PNG_END);
        put("notes.txt", b"");
        assert!(names(&mut folder).is_empty());
        assert_eq!(folder.alone(), 2);
        // A partly written file is not returned before its end is there.
        put("depth_cam_right_45.0.png", &PNG_END[..7]);
        put("depth_cam_right_orig_1_17.png", &PNG_END);
        let pairs = folder.look().unwrap();
        let [pair] = &pairs[..] else {
            panic!("{pairs:?}")
        };
        assert_eq!(pair.name, "orig_1_17");
        assert!(pair.files[0].ends_with("depth_cam_left_orig_1_17.png"));
        assert!(pair.files[1].ends_with("depth_cam_right_orig_1_17.png"));
        assert!(names(&mut folder).is_empty());
        put("depth_cam_right_45.0.png", &PNG_END);
        assert_eq!(names(&mut folder), ["45.0"]);
        assert_eq!((names(&mut folder).len(), folder.alone()), (0, 0));
        assert!(folder.growing.is_empty());
        // A name that reappears after its files were gone is a new pair.
        let both = ["left", "right"].map(|view| format!("depth_cam_{view}_45.0.png"));
        for file in &both {
            fs::remove_file(root.path().join(file)).unwrap();
        }
        assert!(names(&mut folder).is_empty());
        assert_eq!(folder.taken.len(), 1);
        put(&both[0], &PNG_END[..7]);
        put(&both[1], &PNG_END);
        assert!(names(&mut folder).is_empty());
        assert_eq!(folder.growing.len(), 2);
        fs::remove_file(root.path().join(&both[0])).unwrap();
        assert!(names(&mut folder).is_empty());
        assert!(folder.growing.is_empty());
        put(&both[0], &PNG_END);
        assert_eq!(names(&mut folder), ["45.0"]);
    }

    #[test]
    fn what_stays_half_written_is_handed_out_after_a_second() {
        let root = tempfile::tempdir().unwrap();
        for view in ["left", "right"] {
            fs::write(root.path().join(format!("depth_cam_{view}_1.png")), "half").unwrap();
        }
        let mut folder = PairFolder::new(root.path());
        let started = Instant::now();
        while names(&mut folder).is_empty() {
            assert!(started.elapsed() < 20 * SETTLED);
            std::thread::sleep(Duration::from_millis(20));
        }
        assert!(started.elapsed() >= SETTLED);
    }

    #[test]
    fn pairs_come_in_the_order_of_their_writing() {
        let root = tempfile::tempdir().unwrap();
        let start = SystemTime::now();
        for (seconds, name) in [(0, "9.5"), (1, "10.0"), (2, "10.5")] {
            for view in ["left", "right"] {
                let path = root.path().join(format!("depth_cam_{view}_{name}.png"));
                fs::write(&path, PNG_END).unwrap();
                let file = fs::File::options().write(true).open(&path).unwrap();
                file.set_modified(start + Duration::from_secs(seconds))
                    .unwrap();
            }
        }
        let mut folder = PairFolder::new(root.path());
        assert_eq!(names(&mut folder), ["9.5", "10.0", "10.5"]);
    }
}
