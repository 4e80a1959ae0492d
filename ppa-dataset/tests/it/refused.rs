//! Datasets that fit no layout are rejected, naming the file at fault.

use std::fs;

use ppa_dataset::published::{GrayImage16, Published};

use crate::trees::Tree;

/// The error of reading, with its causes.
fn refusal(tree: &Tree) -> String {
    chain(&Published::read(tree.root()).unwrap_err())
}

fn chain(error: &dyn std::error::Error) -> String {
    let source = error.source().map(|source| format!(": {}", chain(source)));
    format!("{error}{}", source.unwrap_or_default())
}

fn assert_says(said: &str, parts: &[&str]) {
    for part in parts {
        assert!(said.contains(part), "{part:?} is missing in: {said}");
    }
}

#[test]
fn names_that_fit_no_layout_are_reported() {
    for (file, parts) in [
        (
            "patient_0/depth/l/orig/depth_cam_left_18.3.png",
            ["18.3", "multiple of 0.5"],
        ),
        (
            "patient_0/depth/l/orig/depth_cam_top_18.0.png",
            ["depth_cam_top_18.0.png", "depth_cam_left_"],
        ),
        (
            "patient_0/depth/l/orig/depth_cam_left_18.0.PNG",
            [".PNG", "depth_cam_left_"],
        ),
        (
            "patient_0/depth/l/huge/depth_cam_left_18.0.png",
            ["huge", "orig, big"],
        ),
        (
            "patient_0/depth/left/orig/depth_cam_left_18.0.png",
            ["depth/left", "l or r"],
        ),
        (
            "patient_0/xray/l/xray_36.png",
            ["xray_36.png", "xray_image_{step}.png"],
        ),
        (
            "patient_00/depth/l/orig/depth_cam_left_18.0.png",
            ["patient_00", "another name for"],
        ),
        (
            "patient_07/depth/l/orig/depth_cam_left_18.0.png",
            ["patient_07", "without leading zeros"],
        ),
        (
            "patient_x/depth/l/orig/depth_cam_left_18.0.png",
            ["patient_x", "without leading zeros"],
        ),
        (
            "patient_1_l/min/data/dataset/xray/xray_0.png",
            ["patient_1_l", "a dataset must have a single layout"],
        ),
    ] {
        let tree = Tree::synthetic();
        tree.image(file, 900);
        assert_says(&refusal(&tree), &parts);
    }
    for (file, parts) in [
        (
            "patient_1_l/half/data/dataset/xray/xray_0.png",
            ["half", "min, medium or max"],
        ),
        (
            "patient_1_l/min/data/dataset/xray/xray_image_0.png",
            ["xray_image_0.png", "xray_{image}.png"],
        ),
        (
            "patient_1_l/min/data/dataset/depth/depth_cam_left_orig_3.png",
            ["orig_3.png", "{timestamp}"],
        ),
        (
            "patient_01_l/min/data/dataset/xray/xray_0.png",
            ["patient_01_l", "another name for"],
        ),
    ] {
        let tree = Tree::specimen();
        tree.image(file, 900);
        assert_says(&refusal(&tree), &parts);
    }
    let empty = tempfile::tempdir().unwrap();
    assert_says(
        &chain(&Published::read(empty.path()).unwrap_err()),
        &["no images of patients"],
    );
    let nowhere = Published::read(&empty.path().join("nowhere")).unwrap_err();
    assert_says(&chain(&nowhere), &["nowhere", "cannot read"]);
}

#[test]
fn entries_edited_by_hand_are_reported() {
    let labels = "patient_0/labels/l/labels.json";
    let rois = "patient_0/labels/l/roi_depth.json";
    for (file, from, to, parts) in [
        (
            labels,
            "2.5",
            "3.5",
            ["xray_image_91.png", "label 3.5, expected 1 to 3"],
        ),
        (
            labels,
            "2.5",
            "0.5",
            ["xray_image_91.png", "label 0.5, expected 1 to 3"],
        ),
        (labels, "0.5", "-0.5", ["xray_image_91.png", "std -0.5"]),
        (
            labels,
            "\"step\": 91",
            "\"step\": 90",
            ["xray_image_91.png", "step 90"],
        ),
        (
            labels,
            "image_91.png",
            "image_180.png",
            ["image_180.png", "step 91"],
        ),
        (
            labels,
            "\"label\": 2.5,",
            "",
            ["labels.json", "missing field `label`"],
        ),
        (labels, "{", "", ["labels.json", "line 2"]),
        (
            rois,
            "\"image_number\": 91",
            "\"image_number\": 92",
            ["pose 92", "key is for pose 91"],
        ),
        (
            rois,
            "\"camera\": \"cam_left\"",
            "\"camera\": \"cam_right\"",
            ["roi_depth.json", "cam_right"],
        ),
        (
            rois,
            "\"size\": 5",
            "\"size\": 0",
            ["roi_depth.json", "at least one pixel"],
        ),
        (
            rois,
            "\"x_start\": 2",
            "\"x_start\": -2",
            ["roi_depth.json", "-2"],
        ),
    ] {
        let tree = Tree::synthetic();
        tree.edit(file, from, to);
        assert_says(&refusal(&tree), &parts);
    }
}

#[test]
fn entries_of_a_specimen_edited_by_hand_are_reported() {
    let lists = "patient_2_l/max/data/dataset/label";
    let labels = format!("{lists}/quality/labels.json");
    let rois = format!("{lists}/roi/roi_depth.json");
    for (file, from, to, parts) in [
        (
            &labels,
            "1.5",
            "3.5",
            ["xray_0.png", "label is 3.5, expected 1 to 3"],
        ),
        (&labels, "0.353", "-1.353", ["xray_0.png", "std is -1.353"]),
        (
            &labels,
            "\"image_number\": 10",
            "\"image_number\": 0",
            ["pose 0", "key is for pose 10"],
        ),
        (
            &labels,
            "xray_10",
            "xray_0",
            ["labels.json", "is listed twice"],
        ),
        (
            &rois,
            "\"size\": 6",
            "\"size\": 0",
            ["roi_depth.json", "at least one pixel"],
        ),
    ] {
        let tree = Tree::specimen();
        tree.edit(file, from, to);
        assert_says(&refusal(&tree), &parts);
    }
}

#[test]
fn images_that_are_damaged_or_of_other_pixels_are_reported() {
    let tree = Tree::synthetic();
    let name = "patient_0/depth/l/orig/depth_cam_left_90.0.png";
    let path = tree.path(name);
    let whole = GrayImage16::read(&path).unwrap();
    assert_eq!(
        (whole.width, whole.height, whole.pixels[13]),
        (12, 9, 192 + 13)
    );
    let bytes = fs::read(&path).unwrap();
    for length in [0, 7, bytes.len() / 2, bytes.len() - 20] {
        fs::write(&path, &bytes[..length]).unwrap();
        assert_says(
            &chain(&GrayImage16::read(&path).unwrap_err()),
            &[name, "not a complete PNG file"],
        );
    }
    image::GrayImage::new(12, 9).save(&path).unwrap();
    assert_says(
        &chain(&GrayImage16::read(&path).unwrap_err()),
        &[name, "8-bit grey", "16-bit"],
    );
}

#[test]
fn labels_of_two_sources_do_not_mix() {
    let tree = Tree::specimen();
    let file = "patient_1_l/min/data/dataset/label/quality/labels.json";
    let text = fs::read_to_string(tree.path(file)).unwrap();
    let mixed = text.replacen("\"std\"", "\"label_source\": \"readers\", \"std\"", 1);
    assert_ne!(mixed, text);
    fs::write(tree.path(file), mixed).unwrap();
    assert_says(
        &refusal(&tree),
        &["labels.json", "readers", "an unnamed source"],
    );
}
