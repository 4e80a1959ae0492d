//! Commands that only read a dataset change nothing in it.

use std::fs;
use std::os::unix::fs::MetadataExt;
use std::path::Path;

use ppa_dataset::published::inspect;

use super::Trial;
use crate::check::check;
use crate::held_part::held_part;
use crate::status::status;

/// Name, inode, time of change and size of everything below a folder, and of the folder.
fn state(root: &Path) -> Vec<(std::path::PathBuf, u64, i64, i64, u64)> {
    let mut found = Vec::new();
    let mut paths = vec![root.to_owned()];
    while let Some(path) = paths.pop() {
        let metadata = fs::metadata(&path).unwrap();
        if metadata.is_dir() {
            paths.extend(
                fs::read_dir(&path)
                    .unwrap()
                    .map(|entry| entry.unwrap().path()),
            );
        }
        let (changed, fraction) = (metadata.ctime(), metadata.ctime_nsec());
        found.push((path, metadata.ino(), changed, fraction, metadata.len()));
    }
    found.sort();
    found
}

#[test]
fn looking_at_a_dataset_leaves_it_as_it_is() {
    let folder = Trial::new().made();
    let root = folder.path();
    for has_lock in [true, false] {
        if !has_lock {
            fs::remove_file(root.join(".ppa/lock")).unwrap();
        }
        let before = state(root);
        assert!(status(root).unwrap().complete);
        assert_eq!(check(root).unwrap().problems, []);
        assert_eq!(inspect(root).unwrap().flaws, []);
        assert!(held_part(root).unwrap().is_some());
        assert_eq!(state(root), before, "with a lock: {has_lock}");
    }
}
