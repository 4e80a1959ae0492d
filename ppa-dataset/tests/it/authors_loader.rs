//! Reimplementation of the behaviour of the program that the authors published with the specimen dataset
//! (github.com/INB-KI-SIGS/patient-pose-assessment, `data/depth.py`): the rows it loads from a folder are compared with ours.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use ppa_dataset::layout::View;
use ppa_dataset::published::{Pose, Published};
use serde_json::Value;

use crate::trees::Tree;

/// Foot, flexion, camera, number, time stamp, label, region and path of one training image.
type Row = (String, String, String, u64, u64, String, [u64; 3], String);

fn json(path: &Path) -> Value {
    serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap()
}

/// Every labelled image number, for each camera with its region, and the earliest `images_per_xray` images of it.
///
/// Like theirs, it fails if a foot lacks a flexion's labels or a labelled number lacks its region.
pub fn rows(root: &Path, images_per_xray: usize) -> BTreeSet<Row> {
    let mut rows = BTreeSet::new();
    for foot in fs::read_dir(root).unwrap() {
        let foot = foot.unwrap().path();
        let name = foot.file_name().unwrap().to_str().unwrap().to_owned();
        if !name.starts_with("patient_") {
            continue;
        }
        for flexion in ["max", "medium", "min"] {
            let dataset = foot.join(flexion).join("data/dataset");
            let labels = json(&dataset.join("label/quality/labels.json"));
            let rois = json(&dataset.join("label/roi/roi_depth.json"));
            for camera in ["cam_left", "cam_right"] {
                for label in labels.as_object().unwrap().values() {
                    let number = label["image_number"].as_u64().unwrap();
                    let mut of_camera = rois.as_object().unwrap().values();
                    let roi = of_camera
                        .find(|roi| roi["camera"] == camera && roi["image_number"] == number)
                        .expect("a labelled image has a region");
                    let prefix = format!("depth_{camera}_orig_{number}_");
                    let files = fs::read_dir(dataset.join("depth")).unwrap();
                    let mut files: Vec<_> = files
                        .filter_map(|file| {
                            let path = file.unwrap().path();
                            let stem = path.file_stem().unwrap().to_str().unwrap();
                            let time = stem.strip_prefix(&prefix)?.parse::<u64>().unwrap();
                            Some((time, path))
                        })
                        .collect();
                    files.sort();
                    for (time, path) in files.into_iter().take(images_per_xray) {
                        rows.insert((
                            name.clone(),
                            flexion.to_owned(),
                            camera.to_owned(),
                            number,
                            time,
                            label["label"].to_string(),
                            ["x_start", "y_start", "size"].map(|key| roi[key].as_u64().unwrap()),
                            path.strip_prefix(root)
                                .unwrap()
                                .to_str()
                                .unwrap()
                                .to_owned(),
                        ));
                    }
                }
            }
        }
    }
    rows
}

/// The same rows from our reader.
pub fn our_rows(root: &Path) -> BTreeSet<Row> {
    let mut rows = BTreeSet::new();
    for pair in Published::read(root).unwrap().pairs {
        let Pose::Recorded {
            flexion,
            image_number,
            timestamp,
        } = pair.pose
        else {
            panic!("{:?} is not of the specimen layout", pair.pose);
        };
        for view in View::ALL {
            let (Some(depth), Some(label)) = (pair.depth(view), &pair.label) else {
                continue;
            };
            let roi = depth.roi.as_ref().unwrap();
            rows.insert((
                format!("patient_{}_{}", pair.limb.patient, pair.limb.side_letter()),
                flexion.name().to_owned(),
                view.name().to_owned(),
                u64::from(image_number),
                timestamp,
                serde_json::to_string(&label.label).unwrap(),
                [roi.x_start, roi.y_start, roi.size].map(u64::from),
                depth.file.clone(),
            ));
        }
    }
    rows
}

#[test]
fn we_read_the_images_that_the_authors_loader_reads() {
    let tree = Tree::specimen();
    let theirs = rows(tree.root(), usize::MAX);
    assert_eq!(theirs.len(), 3 * 3 * 2 * 4);
    assert_eq!(our_rows(tree.root()), theirs);
    assert_eq!(rows(tree.root(), 1).len(), 3 * 3 * 2 * 2);
}
