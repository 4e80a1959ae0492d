//! Networks that predict the quality of the page's poses.

use std::fs;
use std::path::Path;
use std::sync::LazyLock;
use std::sync::atomic::AtomicBool;

use axum::http::StatusCode;
use ppa_core::Side;
use ppa_generate::{Case, DepthView, Plan, PreparedLimb, SceneSetup, VisibleLimb};
use ppa_learn::DeviceName;
use ppa_learn::frames::PairPredictor;
use ppa_learn::train::{TrainConfig, train};
use ppa_studio::{Networks, Opening, Studio};
use serde_json::json;
use tempfile::TempDir;

use crate::browser::{Browser, phantom};

/// Trains networks of the left and of the right camera for one step each.
pub fn networks() -> Networks {
    static TRAINED: LazyLock<TempDir> = LazyLock::new(|| {
        let folder = tempfile::tempdir().unwrap();
        for patient in 0..2 {
            write_person(&folder.path().join(format!("data/patient_{patient}")));
        }
        for views in ["left", "right"] {
            // With torchvision's initial values and statistics of the training images, outputs depend on the images after one step.
            let text = format!(
                "preset = \"quick\"\nviews = {views:?}\nmirror = true\nside = 32\nsteps = 1\nbatch_size = 4\n\
                 recompute_statistics = 4\nnetwork.last_layer = \"torchvision\"\n\
                 [[training]]\ndataset = \"data\"\npatients = [0]\n[[evaluation]]\ndataset = \"data\"\npatients = [1]\n"
            );
            let file = folder.path().join(format!("{views}.toml"));
            fs::write(&file, text).unwrap();
            let config = TrainConfig::read(&file).unwrap();
            let run = folder.path().join(views);
            fs::create_dir(&run).unwrap();
            train(&config, &run, &AtomicBool::new(false), |_| {}).unwrap();
        }
        folder
    });
    Networks {
        left: TRAINED.path().join("left"),
        right: Some(TRAINED.path().join("right")),
        confidence: None,
    }
}

/// Writes two poses of a patient with images of gradients.
fn write_person(root: &Path) {
    let (depth, labels) = (root.join("depth/l/orig"), root.join("labels/l"));
    fs::create_dir_all(&depth).unwrap();
    fs::create_dir_all(&labels).unwrap();
    let (mut grades, mut regions) = (json!({}), json!({}));
    for step in [0, 90] {
        for view in ["cam_left", "cam_right"] {
            let name = format!("depth_{view}_{:.1}.png", f64::from(step) / 2.0);
            let value = |x, y| image::Luma([(700 + step + (x * y) % 300) as u16]);
            let picture = image::ImageBuffer::from_fn(50, 50, value);
            picture.save(depth.join(&name)).unwrap();
            regions[name] = json!({"camera": view, "image_number": step, "x_start": 1, "y_start": 2, "size": 45});
        }
        grades[format!("xray_image_{step}.png")] =
            json!({"label": 1.0 + f64::from(step) / 90.0, "std": 0.0, "step": step});
    }
    for (name, entries) in [("labels.json", grades), ("roi_depth.json", regions)] {
        fs::write(labels.join(name), entries.to_string()).unwrap();
    }
}

#[test]
fn answers_are_those_of_predict_for_the_images_in_files() {
    let folder = tempfile::tempdir().unwrap();
    let case = phantom(folder.path());
    let browser = Browser::opened(
        folder,
        &Opening {
            networks: Some(networks()),
            ..Opening::of(&case)
        },
    );
    let answer = browser.post("/api/depth", &json!({ "angle_deg": 18.0 }));
    assert_eq!(answer.status, StatusCode::OK, "{}", answer.text());
    let report: serde_json::Value =
        serde_json::from_slice(answer.headers["x-report"].as_bytes()).unwrap();

    let plan = Plan::new(Vec::new());
    let setup = SceneSetup::of_plan(&plan).unwrap();
    let limb = PreparedLimb::of_case(&Case::read(&case).unwrap()).unwrap();
    let limb = VisibleLimb::new(limb).unwrap();
    let views = limb.depth_views(&setup, &plan, 18.0, plan.seed).unwrap();
    let file = |view: &DepthView| {
        let path = browser
            .folder
            .path()
            .join(format!("{}.png", view.view.name()));
        view.image.write_png(&path).unwrap();
        path
    };
    let files = [file(&views[0]), file(&views[1])];
    let regions = [views[0].region.unwrap(), views[1].region.unwrap()];
    let networks = networks();
    let (left, right) = (&networks.left, networks.right.as_deref());
    let cpu = DeviceName::Cpu;
    let predictor = PairPredictor::new(left, right, regions, Some(Side::Right), cpu).unwrap();
    let expected = predictor
        .predict(files.each_ref().map(|file| &**file))
        .unwrap();
    assert_eq!(report["network"]["prediction"], json!(expected));
    let command = report["network_command"].as_str().unwrap();
    for (camera, region) in ["left", "right"].iter().zip(regions) {
        let (x, y, size) = (region.x_start, region.y_start, region.size);
        let option = format!(" --roi-{camera} {x},{y},{size} ");
        assert!(command.contains(&option), "{command}");
    }
    assert!(command.ends_with(" --stdin"), "{command}");
}

#[test]
fn a_training_that_is_not_finished_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let case = phantom(folder.path());
    let opening = Opening {
        networks: Some(Networks {
            left: folder.path().to_owned(),
            ..Networks::default()
        }),
        ..Opening::of(&case)
    };
    let Err(error) = Studio::open(&opening) else {
        panic!("opened")
    };
    assert!(error.to_string().contains("config.toml"), "{error}");
}
