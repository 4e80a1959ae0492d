//! Datasets whose images do not fit their lists.

use std::fs;

use ppa_dataset::published::{Flaw, Published, inspect};
use ppa_dataset::sha256_of_file;

use crate::trees::Tree;

fn flaws(tree: &Tree) -> Vec<String> {
    let found = inspect(tree.root()).unwrap();
    found.flaws.iter().map(Flaw::to_string).collect()
}

#[test]
fn a_whole_dataset_has_no_flaws() {
    let found = inspect(Tree::synthetic().root()).unwrap();
    assert_eq!(found.flaws, []);
    assert_eq!((found.patients, found.limbs, found.pairs), (2, 3, 12));
    assert_eq!((found.depth_images, found.regions), (24, 16));
    assert_eq!(
        (found.radiographs, found.labelled, found.manifest),
        (4, 8, false)
    );
    assert_eq!(inspect(Tree::specimen().root()).unwrap().flaws, []);
}

#[test]
fn each_flaw_is_reported_with_its_file() {
    let file = "patient_0/depth/r/orig/depth_cam_left_45.5.png";
    type Break<'a> = &'a dyn Fn(&Tree);
    let broken: [(&str, Break); 6] = [
        ("is not a complete PNG file", &|tree| {
            let bytes = fs::read(tree.path(file)).unwrap();
            fs::write(tree.path(file), &bytes[..bytes.len() / 2]).unwrap();
        }),
        ("expected 16-bit grey", &|tree| {
            image::RgbImage::new(12, 9).save(tree.path(file)).unwrap();
        }),
        (
            "has 12 x 9 pixels, but its region reaches to column 13 and row 12",
            &|tree| {
                let roi = "\"camera\": \"cam_left\",\n    \"image_number\": 91,\n    \"size\": 5";
                tree.edit(
                    "patient_0/labels/r/roi_depth.json",
                    roi,
                    &roi.replace("size\": 5", "size\": 11"),
                );
            },
        ),
        ("its region reaches to column 4294967295", &|tree| {
            let roi = "\"camera\": \"cam_left\",\n    \"image_number\": 91,\n    \"size\": 5";
            tree.edit(
                "patient_0/labels/r/roi_depth.json",
                roi,
                &roi.replace("size\": 5", "size\": 4294967295"),
            );
        }),
        ("has no counterpart from the other camera", &|tree| {
            fs::remove_file(tree.path("patient_0/depth/r/orig/depth_cam_right_45.5.png")).unwrap();
        }),
        ("are the same image, but of different persons", &|tree| {
            let other = "patient_12/depth/r/orig/depth_cam_left_45.5.png";
            fs::copy(tree.path(file), tree.path(other)).unwrap();
        }),
    ];
    for (expected, break_it) in broken {
        let tree = Tree::synthetic();
        break_it(&tree);
        let said = flaws(&tree);
        let report = said
            .iter()
            .any(|flaw| flaw.contains(file) && flaw.contains(expected));
        assert!(report, "{expected:?} is missing in {said:?}");
    }
}

/// The layout allows a missing camera; it is then missing in each pose.
#[test]
fn a_limb_that_one_camera_saw_alone_is_no_flaw() {
    let tree = Tree::synthetic();
    for step in ["45.5", "90.0"] {
        for shape in ["orig", "big"] {
            let file = format!("patient_12/depth/r/{shape}/depth_cam_right_{step}.png");
            fs::remove_file(tree.path(&file)).unwrap();
        }
    }
    assert_eq!(flaws(&tree), [""; 0]);
}

#[test]
fn files_of_no_depth_image_are_reported() {
    let tree = Tree::synthetic();
    for camera in ["left", "right"] {
        for shape in ["orig", "big"] {
            let file = format!("patient_0/depth/r/{shape}/depth_cam_{camera}_90.0.png");
            fs::remove_file(tree.path(&file)).unwrap();
        }
    }
    let radiograph = "patient_0/xray/r/xray_image_180.png";
    assert_eq!(
        flaws(&tree),
        [
            format!("{radiograph} shows a pose without depth images"),
            "patient_0/labels/r/labels.json has a label for pose 180, which has no depth image".to_owned(),
            "patient_0/labels/r/roi_depth.json has a region of pose 180 for cam_left, which has no depth image of it".to_owned(),
            "patient_0/labels/r/roi_depth.json has a region of pose 180 for cam_right, which has no depth image of it".to_owned(),
        ]
    );
    fs::write(tree.path(radiograph), "no picture").unwrap();
    let report = flaws(&tree);
    let damaged =
        |flaw: &String| flaw.contains(radiograph) && flaw.contains("not a complete PNG file");
    assert!(report.iter().any(damaged), "{report:?}");

    let tree = Tree::specimen();
    let folder = "patient_1_r/max/data/dataset";
    for camera in ["left", "right"] {
        let file = format!("{folder}/depth/depth_cam_{camera}_orig_0_1000.png");
        fs::remove_file(tree.path(&file)).unwrap();
    }
    let report = flaws(&tree);
    assert_eq!(report.len(), 4, "{report:?}");
    let expected = format!("{folder}/xray/xray_0.png shows a pose without depth images");
    assert_eq!(report[0], expected);
}

#[test]
fn tallies_scans_and_labels_are_compared_with_the_lists() {
    let tree = Tree::generated();
    assert_eq!(flaws(&tree), unlisted(&tree));
    let tallies = "patient_0/xray/r/xray_image_91.exr";
    fs::write(tree.path(tallies), "others").unwrap();
    let said = flaws(&tree);
    let altered = |flaw: &String| flaw.starts_with(&format!("{tallies} is altered: its hash is "));
    assert!(said.iter().any(altered), "{said:?}");
    fs::remove_file(tree.path(tallies)).unwrap();
    let missing = format!("{tallies} is listed in manifest.jsonl, but missing");
    assert!(flaws(&tree).contains(&missing));

    let tree = Tree::generated();
    let [first, second] = [0, 12].map(|patient| format!("\"{patient:064}\""));
    tree.edit("dataset.json", &second, &first);
    let same = "patients 0 and 12 come from the same scan according to dataset.json";
    assert!(flaws(&tree).contains(&same.to_owned()));

    // A label states the radiograph it was given to.
    let tree = Tree::generated();
    let labels = "patient_0/labels/r/labels.json";
    let hash = sha256_of_file(&tree.path("patient_0/xray/r/xray_image_91.png")).unwrap();
    let bound = |hash: &str| format!("\"radiograph_sha256\": \"{hash}\", \"step\": 91");
    tree.edit(labels, "\"step\": 91", &bound(&hash));
    assert_eq!(flaws(&tree), unlisted(&tree));
    Published::read(tree.root()).unwrap();
    tree.edit(labels, &bound(&hash), &bound("0123"));
    let outdated = "1 label of radiographs that have since been replaced, the first at step 91";
    assert!(flaws(&tree).iter().any(|flaw| flaw.contains(outdated)));
    let refused = Published::read(tree.root()).unwrap_err().to_string();
    assert!(
        refused.contains(labels) && refused.contains(outdated),
        "{refused}"
    );
    fs::remove_file(tree.path("manifest.jsonl")).unwrap();
    let refused = Published::read(tree.root()).unwrap_err().to_string();
    assert!(refused.contains(outdated), "{refused}");
}

/// The manifest of [`Tree::generated`] lists only some of its images.
fn unlisted(tree: &Tree) -> Vec<String> {
    let manifest = fs::read_to_string(tree.path("manifest.jsonl")).unwrap();
    let dataset = Published::read(tree.root()).unwrap();
    let mut files: Vec<_> = dataset
        .pairs
        .iter()
        .flat_map(|pair| [&pair.left, &pair.right])
        .flatten()
        .map(|depth| depth.file.clone())
        .chain(
            dataset
                .pairs
                .iter()
                .filter_map(|pair| pair.radiograph.clone()),
        )
        .filter(|file| !manifest.contains(file.as_str()))
        .collect();
    files.sort();
    files.dedup();
    let report = files
        .iter()
        .map(|file| format!("{file} is not listed in manifest.jsonl"));
    report.collect()
}
