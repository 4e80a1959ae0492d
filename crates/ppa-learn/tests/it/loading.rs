//! Datasets on disk, their samples, and batches of them.

use std::fs;
use std::num::NonZeroUsize;
use std::path::Path;
use std::sync::Arc;

use ppa_learn::data::{
    Augmentation, Balanced, Batch, DataError, Images, Loader, Order, Views, read_samples,
};
use tempfile::TempDir;

const SIDE: usize = 30;

fn png(path: &Path, side: u32, value: impl Fn(u32, u32) -> u16) {
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    image::ImageBuffer::from_fn(side, side, |x, y| image::Luma([value(x, y)]))
        .save(path)
        .unwrap();
}

/// Two persons, right feet, poses at 0, 45 and 90 degrees with labels 1, 2 and 3.
fn synthetic() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for patient in 0..2 {
        let root = folder.path().join(format!("patient_{patient}"));
        let mut labels = serde_json::Map::new();
        let mut rois = serde_json::Map::new();
        for (step, label) in [(0, 1.0), (90, 2.0), (180, 3.0)] {
            for view in ["left", "right"] {
                let angle = f64::from(step) / 2.0;
                let name = format!("depth_cam_{view}_{angle:.1}.png");
                let value = |x, y| (700 + step + x * y % 300) as u16;
                png(&root.join("depth/r/orig").join(&name), 60, value);
                let camera = format!("cam_{view}");
                let roi = serde_json::json!({"camera": camera, "image_number": step, "x_start": 10, "y_start": 5, "size": 48});
                rois.insert(name, roi);
            }
            let entry = serde_json::json!({"label": label, "std": 0.0, "step": step});
            labels.insert(format!("xray_image_{step}.png"), entry);
        }
        let folder = root.join("labels/r");
        fs::create_dir_all(&folder).unwrap();
        fs::write(
            folder.join("labels.json"),
            serde_json::to_string(&labels).unwrap(),
        )
        .unwrap();
        fs::write(
            folder.join("roi_depth.json"),
            serde_json::to_string(&rois).unwrap(),
        )
        .unwrap();
    }
    folder
}

fn n(number: usize) -> NonZeroUsize {
    NonZeroUsize::new(number).unwrap()
}

fn images(folder: &TempDir, views: Views, keep_bytes: usize) -> Arc<Images> {
    let samples = read_samples(folder.path(), None, views, 5).unwrap();
    Arc::new(Images::new(samples, SIDE, keep_bytes).unwrap())
}

fn training(images: &Images, first_batch: u64) -> Order {
    Order::Training {
        balanced: Balanced::new(images.samples()).unwrap(),
        augmentation: Augmentation::default(),
        seed: 3,
        first_batch,
    }
}

fn first_batches(images: &Arc<Images>, first: u64, workers: usize) -> Vec<Batch> {
    let loader = Loader::new(images, &training(images, first), n(4), n(workers));
    loader.take(6).collect::<Result<_, _>>().unwrap()
}

#[test]
fn batches_do_not_depend_on_workers_memory_or_where_training_began() {
    let folder = synthetic();
    let all = images(&folder, Views::Pairs, usize::MAX);
    let none = images(&folder, Views::Pairs, 0);
    let batches = first_batches(&all, 0, 1);
    assert_eq!(batches[0].images.len(), 2);
    assert_eq!(batches[0].images[1].len(), 4 * SIDE * SIDE);
    assert_eq!(batches, first_batches(&all, 0, 3));
    assert_eq!(batches, first_batches(&none, 0, 2));
    assert_eq!(batches[2..], first_batches(&all, 2, 2)[..4]);
    assert_ne!(batches[0], batches[1]);
}

#[test]
fn evaluation_sees_each_sample_once_and_the_last_batch_is_short() {
    let folder = synthetic();
    let images = images(&folder, Views::Unified, 20_000);
    assert_eq!(images.samples().len(), 12);
    for workers in 1..4 {
        let loader = Loader::new(&images, &Order::Once, n(5), n(workers));
        let batches: Vec<Batch> = loader.collect::<Result<_, _>>().unwrap();
        let lengths: Vec<usize> = batches.iter().map(|b| b.labels.len()).collect();
        assert_eq!(lengths, [5, 5, 2]);
        let seen: Vec<usize> = batches.iter().flat_map(|b| b.samples.clone()).collect();
        assert_eq!(seen, (0..12).collect::<Vec<_>>());
        let labels: Vec<f32> = batches.iter().flat_map(|b| b.labels.clone()).collect();
        assert_eq!(labels[..6], [1.0, 1.0, 2.0, 2.0, 3.0, 3.0]);
    }
}

#[test]
fn samples_are_those_of_the_views_and_persons() {
    let folder = synthetic();
    let read = |persons, views| read_samples(folder.path(), persons, views, 5);
    let left = read(Some(&[1]), Views::Left).unwrap();
    assert_eq!(left.len(), 3);
    assert_eq!(left[1].id, "patient_1/depth/r/orig/depth_cam_left_45.0.png");
    assert_eq!((left[1].label, left[1].angle_deg), (2.0, Some(45.0)));
    assert!(left[1].person.ends_with("patient 1"));
    let error = read(Some(&[7]), Views::Left).unwrap_err().to_string();
    assert!(
        error.starts_with("there is no image of patient 7"),
        "{error}"
    );
}

#[test]
fn what_is_missing_or_of_another_size_is_named() {
    let folder = synthetic();
    let labels = folder.path().join("patient_1/labels/r/labels.json");
    fs::remove_file(&labels).unwrap();
    let error = read_samples(folder.path(), None, Views::Left, 5).unwrap_err();
    assert!(
        matches!(&error, DataError::NoLabel(path) if path.ends_with("depth_cam_left_0.0.png")),
        "{error}"
    );
    assert!(read_samples(folder.path(), Some(&[0]), Views::Left, 5).is_ok());

    let folder = synthetic();
    fs::remove_file(folder.path().join("patient_1/labels/r/roi_depth.json")).unwrap();
    let error = read_samples(folder.path(), None, Views::Left, 5).unwrap_err();
    assert!(matches!(error, DataError::NoRoi(_)), "{error}");

    let folder = synthetic();
    let odd = folder
        .path()
        .join("patient_1/depth/r/orig/depth_cam_left_90.0.png");
    png(&odd, 59, |_, _| 900);
    let images = images(&folder, Views::Left, 0);
    let loader = Loader::new(&images, &Order::Once, n(2), n(2));
    let batches: Vec<_> = loader.collect();
    assert!(batches[0].is_ok() && batches[1].is_ok());
    let error = batches[2].as_ref().unwrap_err().to_string();
    assert!(
        error.ends_with("has 59x59 pixels, expected 60x60 as in the other images of its camera"),
        "{error}"
    );
    assert_eq!(batches.len(), 3, "nothing follows an error");
}

#[test]
fn five_frames_of_a_recorded_pose_are_used_the_first_ones() {
    let folder = tempfile::tempdir().unwrap();
    let dataset = folder.path().join("patient_3_l/min/data/dataset");
    for time in 0..7 {
        let name = format!("depth/depth_cam_left_orig_0_{}.png", 1000 + 10 * time);
        png(&dataset.join(name), 20, |_, _| 800);
    }
    let quality = dataset.join("label/quality");
    let roi = dataset.join("label/roi");
    fs::create_dir_all(&quality).unwrap();
    fs::create_dir_all(&roi).unwrap();
    fs::write(
        quality.join("labels.json"),
        r#"{"xray_0.png": {"label": 1.5, "std": 0.35, "image_number": 0}}"#,
    )
    .unwrap();
    fs::write(
        roi.join("roi_depth.json"),
        r#"{"depth_cam_left_orig_0_1000.png": {"camera": "cam_left", "image_number": 0, "x_start": 1, "y_start": 2, "size": 15}}"#,
    )
    .unwrap();
    let samples = read_samples(folder.path(), None, Views::Unified, 5).unwrap();
    let names: Vec<&str> = samples
        .iter()
        .map(|s| s.id.rsplit('_').next().unwrap())
        .collect();
    assert_eq!(
        names,
        ["1000.png", "1010.png", "1020.png", "1030.png", "1040.png"]
    );
    assert!(
        samples
            .iter()
            .all(|s| s.pose == samples[0].pose && s.label == 1.5)
    );
}
