//! Conversion from one layout to the other and back.

use std::fs;
use std::path::Path;
use std::sync::atomic::AtomicBool;

use ppa_dataset::published::{Converted, Flexion, Layout, Published, convert};

use crate::authors_loader;
use crate::trees::Tree;

/// Never set: no test stops the work.
static GO_ON: AtomicBool = AtomicBool::new(false);

/// Everything a reader learns about a dataset except its paths, with the bytes of its images.
fn contents(root: &Path) -> Vec<String> {
    let read = Published::read(root).unwrap();
    let bytes = |file: &str| fs::read(root.join(file)).unwrap();
    let of_pair = |pair: &ppa_dataset::published::ImagePair| {
        let depth = [&pair.left, &pair.right].map(|depth| {
            let depth = depth.as_ref().unwrap();
            (bytes(&depth.file), depth.roi.clone())
        });
        let radiograph = pair.radiograph.as_deref().map(bytes);
        format!(
            "{:?} {:?} {depth:?} {radiograph:?} {:?}",
            pair.limb, pair.pose, pair.label
        )
    };
    read.pairs.iter().map(of_pair).collect()
}

#[test]
fn a_synthetic_dataset_survives_the_specimen_layout() {
    let tree = Tree::synthetic();
    let readers = "\"step\": 91, \"label_source\": \"readers\"";
    let surely = "\"step\": 180, \"label_source\": \"readers\"";
    let labels = "patient_0/labels/l/labels.json";
    tree.edit(labels, "\"step\": 91", readers);
    tree.edit(labels, "\"step\": 180", surely);
    let folder = tempfile::tempdir().unwrap();
    let [specimen, back] = ["specimen", "back"].map(|name| folder.path().join(name));
    let done = convert(
        &Published::read(tree.root()).unwrap(),
        &specimen,
        Flexion::Medium,
        &GO_ON,
    )
    .unwrap();
    let expected = Converted {
        depth_images: 24,
        radiographs: 4,
        labels: 4,
        ..Converted::default()
    };
    assert_eq!(done, expected);
    let read = Published::read(&specimen).unwrap();
    assert_eq!(read.layout, Layout::Specimen);
    // The authors' program stops if the lists of a flexion are missing, and loads only labelled images.
    let theirs = authors_loader::rows(&specimen, usize::MAX);
    assert_eq!(theirs.len(), 2 * 2 * 2 * 2);
    assert_eq!(authors_loader::our_rows(&specimen), theirs);
    assert_eq!(
        convert(&read, &back, Flexion::Medium, &GO_ON).unwrap(),
        expected
    );
    assert!(contents(&back) == contents(tree.root()));
}

#[test]
fn the_earliest_image_of_each_recorded_pose_is_taken() {
    let tree = Tree::specimen();
    // A radiograph of a pose that no camera saw.
    tree.image("patient_1_l/max/data/dataset/xray/xray_7.png", 9000);
    let folder = tempfile::tempdir().unwrap();
    let to = folder.path().join("synthetic");
    let done = convert(
        &Published::read(tree.root()).unwrap(),
        &to,
        Flexion::Max,
        &GO_ON,
    )
    .unwrap();
    // Three feet, two poses and cameras; 3 · 3 · 2 · 4 images in all.
    let expected = Converted {
        depth_images: 12,
        radiographs: 6,
        labels: 6,
        left_out: 60,
        radiographs_left_out: 13,
        labels_left_out: 12,
    };
    assert_eq!(done, expected);
    let read = Published::read(&to).unwrap();
    assert_eq!(
        (read.layout, read.patients()),
        (Layout::Synthetic, vec![1, 2])
    );
    let bytes = |root: &Path, file: &str| fs::read(root.join(file)).unwrap();
    assert!(
        bytes(&to, "patient_1/depth/l/orig/depth_cam_right_5.0.png")
            == bytes(
                tree.root(),
                "patient_1_l/max/data/dataset/depth/depth_cam_right_orig_10_999.png"
            )
    );
    assert!(
        read.pairs
            .iter()
            .all(|pair| pair.label.is_some() && pair.radiograph.is_some())
    );
}

#[test]
fn what_cannot_be_converted_leaves_nothing() {
    let tree = Tree::specimen();
    let folder = tempfile::tempdir().unwrap();
    let full = folder.path().join("full");
    fs::create_dir(&full).unwrap();
    fs::write(full.join("notes.txt"), "kept").unwrap();
    let read = Published::read(tree.root()).unwrap();
    convert(&read, &full, Flexion::Min, &GO_ON).unwrap_err();
    let far = "patient_1_l/min/data/dataset";
    tree.image(&format!("{far}/depth/depth_cam_left_orig_400_1.png"), 800);
    tree.edit(
        &format!("{far}/label/quality/labels.json"),
        "\"xray_10.png\"",
        "\"xray_400.png\"",
    );
    tree.edit(
        &format!("{far}/label/quality/labels.json"),
        "\"image_number\": 10",
        "\"image_number\": 400",
    );
    let read = Published::read(tree.root()).unwrap();
    let error = convert(&read, &folder.path().join("out"), Flexion::Min, &GO_ON).unwrap_err();
    let cause = std::error::Error::source(&error).unwrap().to_string();
    assert!(
        cause.contains("xray_image_400.png is at 200 degrees"),
        "{error}: {cause}"
    );
    let left: Vec<_> = fs::read_dir(folder.path())
        .unwrap()
        .map(|e| e.unwrap().file_name())
        .collect();
    assert_eq!(left, ["full"]);
    assert_eq!(fs::read_dir(&full).unwrap().count(), 1);
}
