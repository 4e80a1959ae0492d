//! Single bits flipped anywhere in a dataset.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use ppa_dataset::published::inspect;

use super::{Draw, Trial, contents, in_place};
use crate::check::check;
use crate::job::Progress;
use crate::merge::merge;

/// Every file of a dataset that has content, so that a bit of it can be flipped.
fn files(root: &Path) -> Vec<PathBuf> {
    let files = contents(root).into_iter();
    let files = files.filter(|(_, bytes)| !bytes.is_empty());
    files.map(|(file, _)| file).collect()
}

/// Flips one bit of a random file, each with equal probability. Returns it with its bytes before and after.
fn flip(root: &Path, files: &[PathBuf], draw: &mut Draw) -> (PathBuf, Vec<u8>, Vec<u8>) {
    let file = files[draw.below(files.len())].clone();
    let before = fs::read(root.join(&file)).unwrap();
    let mut after = before.clone();
    let bit = draw.below(8 * after.len());
    after[bit / 8] ^= 1 << (bit % 8);
    fs::write(root.join(&file), &after).unwrap();
    (file, before, after)
}

#[test]
fn each_of_a_thousand_flipped_bits_is_found() {
    let mut draw = Draw(11);
    for (part, flips) in [("1/1", 700), ("2/2", 300)] {
        let folder = Trial {
            part,
            ..Trial::new()
        }
        .made();
        let root = folder.path();
        assert_eq!(check(root).unwrap().problems, []);
        assert_eq!(inspect(root).unwrap().flaws, []);
        let files = files(root);
        for _ in 0..flips {
            let (file, before, _) = flip(root, &files, &mut draw);
            let found = check(root).map_or(true, |check| !check.problems.is_empty());
            assert!(found, "{} is not reported", file.display());
            // Without the records, as in a published copy, everything else is covered as well.
            if !file.starts_with(".ppa") {
                let found = inspect(root).map_or(true, |found| !found.flaws.is_empty());
                assert!(found, "{} is not reported without records", file.display());
            }
            fs::write(root.join(file), before).unwrap();
        }
        assert_eq!(check(root).unwrap().problems, []);
    }
}

#[test]
fn a_flipped_bit_is_healed_and_its_file_kept() {
    let mut draw = Draw(12);
    for part in ["1/1", "2/2"] {
        let trial = Trial {
            part,
            ..Trial::new()
        };
        let folder = trial.made();
        let root = folder.path();
        let expected = contents(root);
        let files = files(root);
        for _ in 0..50 {
            let (file, _, after) = flip(root, &files, &mut draw);
            let summary = trial.run(root).unwrap();
            assert!(in_place(root) == expected, "{}", file.display());
            let name = file.to_str().unwrap().to_owned();
            assert!(summary.healed.contains(&name), "{name}: {summary:?}");
            let kept = root.join(&summary.set_aside[0]);
            assert!(fs::read(kept).unwrap() == after, "{name}: {summary:?}");
        }
    }
}

/// A merge either refuses a damaged shard or leaves the bytes of an undamaged one.
#[test]
fn a_flipped_bit_in_a_shard_reaches_no_merged_dataset() {
    let expected = Trial::new().fresh();
    let shards = ["1/2", "2/2"].map(|part| {
        Trial {
            part,
            ..Trial::new()
        }
        .made()
    });
    let folders = shards.each_ref().map(|shard| shard.path().to_owned());
    let files = files(&folders[1]);
    let mut draw = Draw(13);
    let go = AtomicBool::new(false);
    let mut refused = 0;
    for _ in 0..60 {
        let (file, before, _) = flip(&folders[1], &files, &mut draw);
        let merged = tempfile::tempdir().unwrap();
        match merge(&folders, merged.path(), false, &go, &|_: Progress| {}) {
            Err(_) => refused += 1,
            Ok(_) => assert!(contents(merged.path()) == expected, "{}", file.display()),
        }
        fs::write(folders[1].join(file), before).unwrap();
    }
    // All but the lists, which a merge does not read.
    assert!(refused > 30, "{refused}");
}
