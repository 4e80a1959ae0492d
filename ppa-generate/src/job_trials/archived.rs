//! Datasets in archives: the same files as in a folder, despite interruption and damage.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use ppa_dataset::findings::FindingCode;

use super::{Draw, Trial, contents};
use crate::archived_dataset::ArchivedDataset;
use crate::check::{Problem, check};
use crate::held_part::held_part;
use crate::job::Summary;
use crate::merge::{MergeError, merge};
use crate::status::status;

/// Two limbs in ten poses.
fn trial() -> Trial {
    Trial {
        to_deg: 4.5,
        ..Trial::new()
    }
}

/// A folder for an archive, and the path of the archive.
fn place() -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("dataset.tar");
    (folder, path)
}

/// The bytes of the archive of an uninterrupted run.
fn whole(trial: &Trial) -> Vec<u8> {
    let (_folder, path) = place();
    trial.run(&path).unwrap();
    fs::read(path).unwrap()
}

fn extracted(path: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let to = tempfile::tempdir().unwrap();
    let archive = ArchivedDataset::open(path).unwrap();
    archive.extract(to.path()).unwrap();
    contents(to.path())
}

/// The files of a fresh run in a folder; only the lock is not in the archive.
fn files(trial: &Trial) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut files = trial.fresh();
    files.remove(Path::new(".ppa/lock")).unwrap();
    files
}

fn merged(shards: &[PathBuf], root: &Path, replace: bool) -> Result<Summary, MergeError> {
    merge(shards, root, replace, &AtomicBool::new(false), &|_| {})
}

/// Three shards, the second in a folder.
fn shards(of: &Trial, folder: &Path) -> Vec<PathBuf> {
    let parts = [("1/3", "1.tar"), ("2/3", "2"), ("3/3", "3.tar")];
    let shard = |(part, name)| {
        let path = folder.join(name);
        Trial { part, ..of.clone() }.run(&path).unwrap();
        path
    };
    parts.map(shard).to_vec()
}

#[test]
fn an_archive_holds_the_files_of_the_folder() {
    let (_folder, path) = place();
    let made = trial().run(&path).unwrap();
    let in_folder = tempfile::tempdir().unwrap();
    assert_eq!(made, trial().run(in_folder.path()).unwrap());
    assert!(extracted(&path) == files(&trial()));
    let found = status(&path).unwrap();
    assert!(found.complete && found.made == 20, "{found:?}");
    assert_eq!(found, status(in_folder.path()).unwrap());
    assert_eq!(check(&path).unwrap().problems, []);
    let before = fs::metadata(&path).unwrap().modified().unwrap();
    assert_eq!(trial().run(&path).unwrap().made, 0);
    assert_eq!(fs::metadata(&path).unwrap().modified().unwrap(), before);
}

#[test]
fn an_interrupted_archive_keeps_its_poses() {
    let whole = whole(&trial());
    for fails_at in [0, 1, 7, 19] {
        let (folder, path) = place();
        let failing = Trial {
            fails_at: Some(fails_at),
            ..trial()
        };
        failing.run(&path).unwrap_err();
        let made = status(&path).map_or(0, |found| found.made);
        assert_eq!(path.exists(), made > 0);
        // Poses that ran in parallel with the failed one are kept as well.
        assert!(made >= fails_at && made < 20, "{made}");
        assert_eq!(trial().run(&path).unwrap().made, 20 - made);
        assert!(fs::read(&path).unwrap() == whole);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}

#[test]
fn an_archive_cut_anywhere_is_completed() {
    let failing = Trial {
        fails_at: Some(12),
        ..trial()
    };
    let (_folder, path) = place();
    failing.run(&path).unwrap_err();
    let (grown, whole) = (fs::read(&path).unwrap(), whole(&trial()));
    let made = status(&path).unwrap().made;
    let mut draw = Draw(0x1234_5678_9abc_def1);
    for bytes in [&grown, &whole] {
        for _ in 0..6 {
            // The first member states what the archive is.
            let least = 512 + trial().description().len();
            let length = least + draw.below(bytes.len() - least);
            fs::write(&path, &bytes[..length]).unwrap();
            let left = status(&path).map_or(0, |found| found.made);
            let share = 20 * length / whole.len();
            assert!(
                left + 1 >= share.min(made),
                "{left} poses in {length} bytes"
            );
            assert_eq!(trial().run(&path).unwrap().made, 20 - left, "{length}");
            assert!(fs::read(&path).unwrap() == whole, "{length}");
        }
    }
}

/// A flipped bit is found by its hash or checksum, the pose is made again, and the damaged archive stays.
#[test]
fn flipped_bits_in_an_archive_are_found_and_healed() {
    let whole = whole(&trial());
    let files = files(&trial());
    let mut draw = Draw(0x9e37_79b9_7f4a_7c15);
    for _ in 0..24 {
        let (folder, path) = place();
        let mut bytes = whole.clone();
        let bit = draw.below(8 * bytes.len());
        bytes[bit / 8] ^= 1 << (bit % 8);
        fs::write(&path, &bytes).unwrap();
        // Bits in the padding after data change no file.
        let is_intact = extracted_if_there(&path).is_some_and(|found| found == files);
        let problems = check(&path).map(|found| found.problems);
        if is_intact {
            assert!(problems.is_ok_and(|found| found.is_empty()), "bit {bit}");
            continue;
        }
        assert!(
            problems.map_or(true, |found| !found.is_empty()),
            "bit {bit}"
        );
        let Ok(summary) = trial().run(&path) else {
            // Without a valid dataset.json the content of the archive is unknown.
            assert!(fs::read(&path).unwrap() == bytes, "bit {bit}");
            continue;
        };
        let mut found = extracted(&path);
        found.retain(|name, _| !name.starts_with(".ppa/altered"));
        assert!(found == files, "bit {bit}");
        let kept = fs::read_dir(folder.path()).unwrap().count() > 1;
        assert!(kept || !summary.healed.is_empty(), "bit {bit}: {summary:?}");
    }
}

fn extracted_if_there(path: &Path) -> Option<BTreeMap<PathBuf, Vec<u8>>> {
    ArchivedDataset::open(path).ok()?;
    Some(extracted(path))
}

#[test]
fn an_archive_of_other_settings_is_refused_or_replaced() {
    let other = Trial {
        kvp: 70,
        shapes: vec![ppa_dataset::BodyShape::Orig],
        ..trial()
    };
    let (_folder, path) = place();
    trial().run(&path).unwrap();
    let said = other.run(&path).unwrap_err().to_string();
    let expected = format!(
        "{} holds another dataset: 20 of its 20 poses",
        path.display()
    );
    assert!(said.starts_with(&expected), "{said}");
    let failing = Trial {
        fails_at: Some(9),
        ..other.replacing()
    };
    failing.run(&path).unwrap_err();
    assert!(status(&path).unwrap().made < 20);
    assert!(!status(&path).unwrap().complete);
    other.replacing().run(&path).unwrap();
    assert!(fs::read(&path).unwrap() == whole(&other));
}

#[test]
fn an_archive_follows_an_acknowledged_finding() {
    let acknowledged = Trial {
        acknowledged: vec![FindingCode::LimbTooSmall],
        ..trial()
    };
    let (_folder, path) = place();
    trial().run(&path).unwrap();
    assert_eq!(acknowledged.run(&path).unwrap().made, 0);
    assert!(fs::read(&path).unwrap() == whole(&acknowledged));
}

#[test]
fn files_that_are_no_archives_of_datasets_stay() {
    let (_folder, path) = place();
    for bytes in [&b"notes"[..], &[7; 4096]] {
        fs::write(&path, bytes).unwrap();
        let said = trial().run(&path).unwrap_err().to_string();
        assert!(said.contains("holds no dataset"), "{said}");
        assert_eq!(fs::read(&path).unwrap(), bytes);
    }
}

#[test]
fn shards_of_both_kinds_are_merged_into_either() {
    let folder = tempfile::tempdir().unwrap();
    let shards = shards(&trial(), folder.path());
    assert_eq!(held_part(&shards[0]).unwrap().unwrap().to_string(), "1/3");
    let (to_folder, to_archive) = (folder.path().join("all"), folder.path().join("all.tar"));
    assert_eq!(merged(&shards, &to_folder, false).unwrap().made, 20);
    assert!(contents(&to_folder) == trial().fresh());
    assert_eq!(merged(&shards, &to_archive, false).unwrap().made, 20);
    assert!(fs::read(&to_archive).unwrap() == whole(&trial()));
    assert_eq!(merged(&shards, &to_archive, false).unwrap().made, 0);
    // A damaged image of the merged archive is healed, and the damaged archive stays.
    let whole = fs::read(&to_archive).unwrap();
    let mut altered = whole.clone();
    let image = whole
        .windows(4)
        .rposition(|four| four == b"\x89PNG")
        .unwrap();
    altered[image + 40] ^= 1;
    fs::write(&to_archive, &altered).unwrap();
    let healed = merged(&shards, &to_archive, false).unwrap();
    assert_eq!((healed.made, healed.set_aside.len()), (20, 1));
    assert!(fs::read(&to_archive).unwrap() == whole);
    assert!(fs::read(folder.path().join("all.tar.damaged1")).unwrap() == altered);
    let into_itself = merged(&shards, &shards[0], true).unwrap_err().to_string();
    assert!(
        into_itself.contains("is one of the shards"),
        "{into_itself}"
    );
}

#[test]
fn a_merge_replaces_no_other_archive_unasked() {
    let folder = tempfile::tempdir().unwrap();
    let shards = shards(&trial(), folder.path());
    let path = folder.path().join("all.tar");
    let other = Trial { kvp: 70, ..trial() };
    other.run(&path).unwrap();
    let before = fs::read(&path).unwrap();
    let refused = merged(&shards, &path, false).unwrap_err().to_string();
    assert!(refused.contains("--replace replaces it"), "{refused}");
    assert!(fs::read(&path).unwrap() == before);
    merged(&shards, &path, true).unwrap();
    assert!(fs::read(&path).unwrap() == whole(&trial()));
}

#[test]
fn a_damaged_archive_is_not_merged() {
    let folder = tempfile::tempdir().unwrap();
    let shards = shards(&trial(), folder.path());
    let to = folder.path().join("all.tar");
    let bytes = fs::read(&shards[2]).unwrap();
    let problem = |at: usize| {
        let mut bytes = bytes.clone();
        bytes[at] ^= 1;
        fs::write(&shards[2], bytes).unwrap();
        merged(&shards, &to, false).unwrap_err()
    };
    let image = bytes
        .windows(4)
        .rposition(|four| four == b"\x89PNG")
        .unwrap();
    assert!(matches!(problem(image + 40), MergeError::Altered(_)));
    assert!(matches!(
        problem(image - 512),
        MergeError::Altered(_) | MergeError::File(_)
    ));
    assert!(!to.exists());
    let mut altered = bytes.clone();
    altered[image + 40] ^= 1;
    fs::write(&shards[2], altered).unwrap();
    let found = check(&shards[2]).unwrap().problems;
    assert!(matches!(found[..], [Problem::Altered { .. }]), "{found:?}");
}
