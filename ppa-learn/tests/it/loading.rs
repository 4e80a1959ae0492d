//! Datasets on disk, their samples, and batches of them.

use std::fs;
use std::num::NonZeroUsize;
use std::sync::Arc;

use ppa_dataset::BodyShape;
use ppa_dataset::layout::View;
use ppa_learn::data::{
    Augmentation, Balanced, Batch, DataError, Images, Loader, Order, Sample, Selection, Views,
    read_samples,
};
use tempfile::TempDir;

use crate::toy::{dataset, png};

const SIDE: usize = 30;

fn n(number: usize) -> NonZeroUsize {
    NonZeroUsize::new(number).unwrap()
}

fn images(folder: &TempDir, views: Views, keep_bytes: usize) -> Arc<Images> {
    let samples = read_samples(folder.path(), &Selection::all(views)).unwrap();
    Arc::new(Images::new(samples, SIDE, keep_bytes).unwrap())
}

fn training(images: &Images, first_batch: u64) -> Order {
    Order::Training {
        balanced: Balanced::new(images.samples()).unwrap(),
        augmentation: Some(Augmentation::default()),
        seed: 3,
        first_batch,
    }
}

fn first_batches(images: &Arc<Images>, first: u64, workers: usize) -> Vec<Batch> {
    let loader = Loader::new(images, &training(images, first), n(4), n(workers));
    loader.take(6).collect::<Result<_, _>>().unwrap()
}

#[test]
fn batches_do_not_depend_on_workers_memory_or_start() {
    let folder = dataset(2, &[0, 90, 180]);
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
fn listed_samples_are_loaded_as_evaluation_sees_them() {
    let folder = dataset(2, &[0, 90, 180]);
    let images = images(&folder, Views::Left, usize::MAX);
    let load = |order: &Order| -> Vec<Batch> {
        let loader = Loader::new(&images, order, n(2), n(2)).take(3);
        loader.collect::<Result<_, _>>().unwrap()
    };
    let all = load(&Order::Once);
    let listed = load(&Order::Listed(vec![4, 1, 5]));
    let samples: Vec<_> = listed.iter().map(|batch| batch.samples.clone()).collect();
    assert_eq!(samples, [vec![4, 1], vec![5]]);
    assert_eq!(listed[1].images[0], all[2].images[0][SIDE * SIDE..]);
    // Drawn as in training, but without augmentation.
    let training = training(&images, 0);
    let Order::Training { balanced, seed, .. } = &training else {
        panic!("an order of training")
    };
    let plain = Order::Training {
        balanced: balanced.clone(),
        augmentation: None,
        seed: *seed,
        first_batch: 0,
    };
    let drawn = load(&training);
    for (plain, drawn) in load(&plain).into_iter().zip(drawn) {
        assert_eq!(plain.samples, drawn.samples);
        assert_ne!(plain.images, drawn.images);
        assert_eq!(
            plain.images,
            load(&Order::Listed(plain.samples.clone()))[0].images
        );
    }
}

#[test]
fn evaluation_sees_each_sample_exactly_once() {
    let folder = dataset(2, &[0, 90, 180]);
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
    let folder = dataset(2, &[0, 90, 180]);
    let read = |patients: &[u32]| {
        let selection = Selection {
            patients: Some(patients),
            ..Selection::all(Views::Left)
        };
        read_samples(folder.path(), &selection)
    };
    let left = read(&[1]).unwrap();
    assert_eq!(left.len(), 3);
    assert_eq!(left[1].id, "patient_1/depth/r/orig/depth_cam_left_45.0.png");
    assert_eq!((left[1].label, left[1].angle_deg), (2.0, Some(45.0)));
    assert_eq!(left[1].limb.patient, 1);
    let error = read(&[7]).unwrap_err().to_string();
    assert!(
        error.starts_with("there is no image of patient 7"),
        "{error}"
    );
}

#[test]
fn every_second_pose_begins_with_the_smallest_angle() {
    let folder = dataset(2, &[0, 60, 90, 120, 180]);
    let selection = Selection {
        every_pose: NonZeroUsize::new(2),
        ..Selection::all(Views::Left)
    };
    let samples = read_samples(folder.path(), &selection).unwrap();
    let angles: Vec<_> = samples.iter().filter_map(|s| s.angle_deg).collect();
    assert_eq!(angles, [0.0, 45.0, 90.0, 0.0, 45.0, 90.0]);
}

#[test]
fn what_is_missing_or_of_another_size_is_named() {
    let folder = dataset(2, &[0, 90, 180]);
    let labels = folder.path().join("patient_1/labels/r/labels.json");
    fs::remove_file(&labels).unwrap();
    let error = read_samples(folder.path(), &Selection::all(Views::Left)).unwrap_err();
    assert!(
        matches!(&error, DataError::NoLabel { image, .. } if image.ends_with("depth_cam_left_0.0.png")),
        "{error}"
    );
    let unlabelled = Selection {
        unlabelled: true,
        ..Selection::all(Views::Left)
    };
    let taken = read_samples(folder.path(), &unlabelled).unwrap();
    let without = |s: &&Sample| s.label.is_nan();
    assert_eq!((taken.len(), taken.iter().filter(without).count()), (6, 3));
    let whole = Selection {
        patients: Some(&[0]),
        ..Selection::all(Views::Left)
    };
    assert!(read_samples(folder.path(), &whole).is_ok());

    let folder = dataset(2, &[0, 90, 180]);
    fs::remove_file(folder.path().join("patient_1/labels/r/roi_depth.json")).unwrap();
    let error = read_samples(folder.path(), &Selection::all(Views::Left)).unwrap_err();
    assert!(matches!(error, DataError::NoRoi(_)), "{error}");

    let folder = dataset(2, &[0, 90, 180]);
    let regions = folder.path().join("patient_1/labels/r/roi_depth.json");
    let text = fs::read_to_string(&regions).unwrap();
    fs::write(&regions, text.replace("\"x_start\":10", "\"x_start\":60")).unwrap();
    let error = read_samples(folder.path(), &Selection::all(Views::Left)).unwrap_err();
    assert!(matches!(error, DataError::Region { .. }), "{error}");

    let folder = dataset(2, &[0, 90, 180]);
    for shapes in [
        &[BodyShape::Orig, BodyShape::BumpsA][..],
        &[BodyShape::BumpsA],
    ] {
        let selection = Selection {
            shapes: Some(shapes),
            ..Selection::all(Views::Left)
        };
        let error = read_samples(folder.path(), &selection).unwrap_err();
        let text = error.to_string();
        assert!(
            text.starts_with("there is no image of body shape bumps_a"),
            "{text}"
        );
    }

    let folder = dataset(2, &[0, 90, 180]);
    let odd = folder
        .path()
        .join("patient_1/depth/r/orig/depth_cam_left_90.0.png");
    png(&odd, 59, |_, _| 900);
    let read = || read_samples(folder.path(), &Selection::all(Views::Left));
    let error = read().unwrap_err().to_string();
    assert!(
        error.ends_with(
            "depth_cam_left_90.0.png has 59x59 pixels, expected 60x60 as in the other images of its camera"
        ),
        "{error}"
    );
    fs::write(&odd, "no image").unwrap();
    let error = read().unwrap_err().to_string();
    assert!(error.ends_with("is not a complete PNG file"), "{error}");
    let grey = image::GrayImage::from_pixel(60, 60, image::Luma([9]));
    grey.save(&odd).unwrap();
    let error = read().unwrap_err().to_string();
    assert!(error.contains("holds 8-bit grey pixels"), "{error}");
}

#[test]
fn an_image_that_changed_since_is_named_and_ends_the_batches() {
    let folder = dataset(2, &[0, 90, 180]);
    let images = images(&folder, Views::Left, 0);
    let odd = folder
        .path()
        .join("patient_1/depth/r/orig/depth_cam_left_90.0.png");
    png(&odd, 59, |_, _| 900);
    let loader = Loader::new(&images, &Order::Once, n(2), n(2));
    let batches: Vec<_> = loader.collect();
    assert!(batches[0].is_ok() && batches[1].is_ok());
    let error = batches[2].as_ref().unwrap_err().to_string();
    assert!(error.contains("has 59x59 pixels"), "{error}");
    assert_eq!(batches.len(), 3, "nothing follows an error");
}

/// A recorded pose with some time stamps of the left and of the right camera.
fn recorded(left: &[u32], right: &[u32]) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let recorded = folder.path().join("patient_3_l/min/data/dataset");
    let mut regions = serde_json::Map::new();
    for (view, times) in [("left", left), ("right", right)] {
        for time in times {
            let name = format!("depth_cam_{view}_orig_0_{time}.png");
            png(&recorded.join("depth").join(&name), 20, |_, _| 800);
            let region = serde_json::json!({
                "camera": format!("cam_{view}"), "image_number": 0, "x_start": 1, "y_start": 2, "size": 15
            });
            regions.insert(name, region);
        }
    }
    regions.retain(|name, _| name.ends_with("_1000.png"));
    let quality = recorded.join("label/quality");
    let roi = recorded.join("label/roi");
    fs::create_dir_all(&quality).unwrap();
    fs::create_dir_all(&roi).unwrap();
    let label = r#"{"xray_0.png": {"label": 1.5, "std": 0.35, "image_number": 0}}"#;
    fs::write(quality.join("labels.json"), label).unwrap();
    let regions = serde_json::to_string(&regions).unwrap();
    fs::write(roi.join("roi_depth.json"), regions).unwrap();
    folder
}

/// Camera, frame and time stamp of each sample.
fn frames(folder: &TempDir, views: Views, frames_per_pose: usize) -> Vec<(View, u32, String)> {
    let selection = Selection {
        frames_per_pose,
        ..Selection::all(views)
    };
    let samples = read_samples(folder.path(), &selection).unwrap();
    let same = |s: &Sample| s.pose == samples[0].pose && s.label == 1.5;
    assert!(samples.iter().all(same));
    let time = |s: &Sample| s.id.rsplit(['_', '.']).nth(1).unwrap().to_owned();
    let frames = samples.iter().map(|s| (s.camera, s.frame, time(s)));
    frames.collect()
}

#[test]
fn five_frames_of_a_recorded_pose_are_used_the_first_ones() {
    let times: Vec<u32> = (0..7).map(|i| 1000 + 10 * i).collect();
    let found = frames(&recorded(&times, &[]), Views::Unified, 5);
    let expected = (0..5).map(|i| (View::Left, i, (1000 + 10 * i).to_string()));
    assert_eq!(found, expected.collect::<Vec<_>>());
}

#[test]
fn frames_of_equal_number_show_one_moment() {
    // The right camera lacks the second moment, the left one the last.
    let folder = recorded(&[1000, 1010, 1020, 1030], &[1000, 1020, 1030, 1040]);
    let times = ["1000", "1020", "1030"];
    let of = |view| (0..3).map(move |i| (view, i as u32, times[i].to_owned()));
    for views in [Views::Left, Views::Pairs] {
        let expected: Vec<_> = of(View::Left).collect();
        assert_eq!(frames(&folder, views, 5), expected);
        assert_eq!(frames(&folder, views, 2), expected[..2]);
    }
    let right: Vec<_> = of(View::Right).collect();
    assert_eq!(frames(&folder, Views::Right, 5), right);
    let mut both = frames(&folder, Views::Unified, 5);
    both.sort();
    assert_eq!(both, of(View::Left).chain(right).collect::<Vec<_>>());
}

#[test]
fn persons_are_known_again_however_the_dataset_is_spelled() {
    let folder = dataset(2, &[0]);
    let inner = folder.path().join("patient_0/..");
    let read = |root| read_samples(root, &Selection::all(Views::Left)).unwrap();
    let (one, other) = (read(folder.path()), read(&inner));
    assert!(ppa_learn::data::check_split(&one, &other).is_err());
}

/// Mirror images of right limbs in front of mirrored cameras, stored as left limbs, are the same samples.
#[test]
fn mirrored_left_limbs_give_the_samples_of_right_ones() {
    let right = dataset(2, &[0, 90, 180]);
    let left = tempfile::tempdir().unwrap();
    for patient in 0..2 {
        let [from, to] =
            [&right, &left].map(|folder| folder.path().join(format!("patient_{patient}")));
        for (angle, (view, other)) in ["0.0", "45.0", "90.0"]
            .iter()
            .flat_map(|angle| [("left", "right"), ("right", "left")].map(|views| (angle, views)))
        {
            let name = |view: &str| format!("depth_cam_{view}_{angle}.png");
            let image = image::open(from.join("depth/r/orig").join(name(view))).unwrap();
            let image = image.into_luma16();
            let last = image.width() - 1;
            png(
                &to.join("depth/l/orig").join(name(other)),
                image.width(),
                |x, y| image.get_pixel(last - x, y).0[0],
            );
        }
        fs::create_dir_all(to.join("labels/l")).unwrap();
        // Columns 10 to 57 of 60 become 2 to 49.
        for file in ["labels.json", "roi_depth.json"] {
            let text = fs::read_to_string(from.join("labels/r").join(file)).unwrap();
            let text = text.replace("\"x_start\":10", "\"x_start\":2");
            fs::write(to.join("labels/l").join(file), text).unwrap();
        }
    }
    for views in [Views::Left, Views::Right, Views::Unified, Views::Pairs] {
        let inputs = |folder: &TempDir, mirror| {
            let selection = Selection {
                mirror,
                ..Selection::all(views)
            };
            let samples = read_samples(folder.path(), &selection).unwrap();
            let images = Arc::new(Images::new(samples, SIDE, 0).unwrap());
            let batch = Loader::new(&images, &Order::Once, n(100), n(1)).next();
            let batch = batch.unwrap().unwrap();
            (batch.images, batch.labels)
        };
        let expected = inputs(&right, true);
        assert!(expected == inputs(&right, false), "{views}");
        assert!(inputs(&left, true) == expected, "{views}");
        assert!(inputs(&left, false) != expected, "{views}");
    }
    // With only one camera, left limbs cannot be shown as right ones.
    let selection = Selection {
        mirror: true,
        ..Selection::all(Views::Left)
    };
    let alone = recorded(&[1000], &[]);
    assert!(read_samples(alone.path(), &Selection::all(Views::Left)).is_ok());
    let error = read_samples(alone.path(), &selection)
        .unwrap_err()
        .to_string();
    assert!(error.contains("the other camera's images"), "{error}");
}
