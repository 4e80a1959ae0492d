//! Bags and archives of a dataset, read back.

use std::fs;
use std::io::Read;
use std::path::Path;
use std::sync::atomic::AtomicBool;

use ppa_dataset::export::{Shards, bag, web_dataset};
use ppa_dataset::published::{Flexion, Published, convert};
use ppa_dataset::sha256_of_file;
use serde_json::Value;

use crate::trees::Tree;

/// Never set: no test stops the work.
static GO_ON: AtomicBool = AtomicBool::new(false);

#[test]
fn a_bag_holds_every_file_but_hidden_ones_with_its_hash() {
    let tree = Tree::generated();
    fs::create_dir(tree.path(".ppa")).unwrap();
    fs::write(tree.path(".ppa/record.json"), "{}").unwrap();
    fs::write(tree.path("100 %.txt"), "odd name").unwrap();
    fs::write(
        tree.path("grades_old.csv"),
        "image,reader,grade\nx,anna,1\n",
    )
    .unwrap();
    // By other programs, under another name.
    let marked = "\u{feff}image,reader,grade\nx,anna,1\n";
    fs::write(tree.path("grades.csv.old"), marked).unwrap();
    fs::write(tree.path("key.csv"), "name,image,sha256\n").unwrap();
    let folder = tempfile::tempdir().unwrap();
    let to = folder.path().join("bag");
    let made = bag(tree.root(), &to, &GO_ON).unwrap();
    let manifest = fs::read_to_string(to.join("manifest-sha256.txt")).unwrap();
    let mut bytes = 0;
    for line in manifest.lines() {
        let (hash, name) = line.split_once("  ").unwrap();
        let path = to.join(name.replace("%25", "%"));
        assert_eq!(sha256_of_file(&path).unwrap(), hash);
        bytes += fs::metadata(path).unwrap().len();
    }
    assert_eq!(
        (manifest.lines().count() as u64, bytes),
        (made.files, made.bytes)
    );
    assert!(manifest.contains("data/100 %25.txt") && !manifest.contains(".ppa"));
    for table in ["grades_old.csv", "key.csv"] {
        assert!(!manifest.contains(table) && !to.join("data").join(table).exists());
    }
    // 24 depth images, 4 radiographs, tallies, 4 lists of labels and regions, manifest, description, split, odd name.
    assert_eq!(made.files, 24 + 4 + 1 + 4 + 4);
    let tags = fs::read_to_string(to.join("tagmanifest-sha256.txt")).unwrap();
    for line in tags.lines() {
        let (hash, name) = line.split_once("  ").unwrap();
        assert_eq!(sha256_of_file(&to.join(name)).unwrap(), hash);
    }
    assert!(
        bag(tree.root(), &to, &GO_ON).is_err(),
        "a bag is not written over"
    );
}

#[test]
fn no_bag_is_made_of_what_is_altered_unfinished_or_no_dataset() {
    let folder = tempfile::tempdir().unwrap();
    let to = folder.path().join("bag");
    let refused = |root: &Path, expected: &str| {
        let said = bag(root, &to, &GO_ON).unwrap_err().to_string();
        assert!(said.contains(expected), "{said}");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    };
    let tree = Tree::generated();
    let image = "patient_0/depth/r/big/depth_cam_left_45.5.png";
    tree.image(image, 77);
    refused(tree.root(), &format!("{image} is altered or missing"));
    fs::remove_file(tree.path(image)).unwrap();
    refused(tree.root(), "its hash is none");

    let tree = Tree::synthetic();
    fs::create_dir(tree.path(".ppa")).unwrap();
    refused(tree.root(), "is not finished");
    #[cfg(unix)]
    {
        let tree = Tree::generated();
        std::os::unix::fs::symlink(".", tree.path("patient_0/loop")).unwrap();
        refused(tree.root(), "loop is neither a file nor a folder");
    }
    let empty = tempfile::tempdir().unwrap();
    refused(empty.path(), "holds no images of patients");
    // Datasets of other authors have no manifest.
    bag(Tree::specimen().root(), &to, &GO_ON).unwrap();
}

#[test]
fn what_is_stopped_leaves_nothing() {
    let stop = AtomicBool::new(true);
    let tree = Tree::generated();
    let folder = tempfile::tempdir().unwrap();
    let to = folder.path().join("out");
    let errors = [
        bag(tree.root(), &to, &stop).unwrap_err().to_string(),
        web_dataset(tree.root(), &to, 3, None, &stop)
            .unwrap_err()
            .to_string(),
        convert(
            &Published::read(tree.root()).unwrap(),
            &to,
            Flexion::Min,
            &stop,
        )
        .unwrap_err()
        .to_string(),
    ];
    for error in errors {
        assert!(error.contains("not"), "{error}");
    }
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
}

/// Names and bytes of the files of an archive, in archive order.
fn archived(path: &Path) -> Vec<(String, Vec<u8>)> {
    let mut archive = tar::Archive::new(fs::File::open(path).unwrap());
    let entries = archive.entries().unwrap().map(|entry| {
        let mut entry = entry.unwrap();
        let mut bytes = Vec::new();
        entry.read_to_end(&mut bytes).unwrap();
        (entry.path().unwrap().to_str().unwrap().to_owned(), bytes)
    });
    entries.collect()
}

#[test]
fn archives_hold_the_samples_of_one_part_in_order() {
    let tree = Tree::generated();
    let folder = tempfile::tempdir().unwrap();
    let [to, again] = ["shards", "again"].map(|name| folder.path().join(name));
    let made = web_dataset(tree.root(), &to, 3, Some("mine"), &GO_ON).unwrap();
    // Person 0: 8 pairs, person 12: 4.
    assert_eq!(
        made,
        Shards {
            shards: 3 + 2,
            samples: 12
        }
    );
    let first = archived(&to.join("test-000000.tar"));
    let names: Vec<_> = first.iter().map(|(name, _)| name.as_str()).collect();
    let of_sample = ["left.png", "right.png", "xray.png", "json"];
    assert_eq!(
        names[..4],
        of_sample.map(|kind| format!("patient_0_l_091_orig.{kind}"))
    );
    assert_eq!(
        first[1].1,
        fs::read(tree.path("patient_0/depth/l/orig/depth_cam_right_45.5.png")).unwrap()
    );
    let row: Value = serde_json::from_slice(&first[3].1).unwrap();
    assert_eq!(
        (
            row["label"]["label"].as_f64(),
            row["right"]["roi"]["size"].as_u64()
        ),
        (Some(2.5), Some(5))
    );
    let train: Vec<_> = (0..2)
        .flat_map(|i| archived(&to.join(format!("train-{i:06}.tar"))))
        .collect();
    assert_eq!(train.len(), 4 * 3);
    assert!(
        train
            .iter()
            .all(|(name, _)| name.starts_with("patient_12_r_"))
    );
    web_dataset(tree.root(), &again, 3, Some("mine"), &GO_ON).unwrap();
    for name in ["test-000002.tar", "train-000001.tar"] {
        assert!(fs::read(to.join(name)).unwrap() == fs::read(again.join(name)).unwrap());
    }
    let specimen = Tree::specimen();
    let made = web_dataset(
        specimen.root(),
        &folder.path().join("specimen"),
        1000,
        None,
        &GO_ON,
    )
    .unwrap();
    assert_eq!(
        made,
        Shards {
            shards: 1,
            samples: 36
        }
    );
}
