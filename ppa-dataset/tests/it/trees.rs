//! Small datasets in the published layouts, written only from the description of the formats.

use std::fs;
use std::path::{Path, PathBuf};

use image::{ImageBuffer, Luma};
use ppa_dataset::sha256_of_file;
use serde_json::{Map, Value, json};

pub const POSE: [[f64; 4]; 4] = [
    [1.0, 0.0, 0.0, 0.1 + 0.2],
    [0.0, 1.0, 0.0, -7.25],
    [0.0, 0.0, 1.0, 1e-17],
    [0.0, 0.0, 0.0, 1.0],
];

/// A dataset in a temporary folder.
pub struct Tree(tempfile::TempDir);

impl Tree {
    /// Person 0 with both sides, radiographs, labels and regions; person 12 with depth images of the right side only.
    pub fn synthetic() -> Self {
        let tree = Self(tempfile::tempdir().unwrap());
        for (patient, side) in [(0, "l"), (0, "r"), (12, "r")] {
            let (mut labels, mut rois) = (Map::new(), Map::new());
            for step in [91_u32, 180] {
                let angle = format!("{:.1}", f64::from(step) / 2.0);
                for camera in ["cam_left", "cam_right"] {
                    for shape in ["orig", "big"] {
                        let name = format!("depth/{side}/{shape}/depth_{camera}_{angle}.png");
                        let fill = 500 * u16::from(side == "r")
                            + patient
                            + step as u16
                            + shape.len() as u16
                            + camera.len() as u16;
                        tree.image(&format!("patient_{patient}/{name}"), fill);
                    }
                    let roi = json!({"camera": camera, "image_number": step, "x_start": 2, "y_start": 1, "size": 5});
                    rois.insert(format!("depth_{camera}_{angle}.png"), roi);
                }
                let name = format!("xray_image_{step}.png");
                let label = if step == 180 { (3.0, 0.0) } else { (2.5, 0.5) };
                labels.insert(
                    name.clone(),
                    json!({"label": label.0, "std": label.1, "step": step}),
                );
                if patient == 0 {
                    tree.image(
                        &format!("patient_0/xray/{side}/{name}"),
                        3000 + 500 * u16::from(side == "r") + step as u16,
                    );
                }
            }
            if patient == 0 {
                tree.json(&format!("patient_0/labels/{side}/labels.json"), labels);
                tree.json(&format!("patient_0/labels/{side}/roi_depth.json"), rois);
            }
        }
        tree
    }

    /// Feet 1 l, 1 r and 2 l with three flexions of two poses each, the second with three images per camera.
    pub fn specimen() -> Self {
        let tree = Self(tempfile::tempdir().unwrap());
        for (number, foot) in ["patient_1_l", "patient_1_r", "patient_2_l"]
            .iter()
            .enumerate()
        {
            for (bend, flexion) in ["min", "medium", "max"].iter().enumerate() {
                let folder = format!("{foot}/{flexion}/data/dataset");
                let (mut labels, mut rois) = (Map::new(), Map::new());
                for (image, times) in [(0, &[1000][..]), (10, &[1000, 999, 20_000])] {
                    for camera in ["cam_left", "cam_right"] {
                        for (i, time) in times.iter().enumerate() {
                            let fill = 700 + 100 * number + 10 * bend + image + i + camera.len();
                            let name = format!("depth/depth_{camera}_orig_{image}_{time}.png");
                            tree.image(&format!("{folder}/{name}"), fill as u16);
                        }
                        let roi = json!({"camera": camera, "image_number": image,
                            "x_start": 1 + number, "y_start": bend, "size": 6 + image / 10});
                        rois.insert(format!("depth_{camera}_orig_{image}.png"), roi);
                    }
                    let name = format!("xray_{image}.png");
                    tree.image(
                        &format!("{folder}/xray/{name}"),
                        (4000 + 100 * number + image) as u16,
                    );
                    let label = json!({"label": 1.5, "std": 0.353_553_390_593_273_8, "image_number": image});
                    labels.insert(name, label);
                }
                tree.json(&format!("{folder}/label/quality/labels.json"), labels);
                tree.json(&format!("{folder}/label/roi/roi_depth.json"), rois);
            }
        }
        tree
    }

    /// The synthetic tree with the lists that `ppa generate` writes, as far as exports read them.
    pub fn generated() -> Self {
        let tree = Self::synthetic();
        fs::write(tree.path("patient_0/xray/r/xray_image_91.exr"), "tallies").unwrap();
        let mut rows = String::new();
        for (file, camera) in [
            (
                "patient_0/depth/r/big/depth_cam_left_45.5.png",
                Some("cam_left"),
            ),
            ("patient_0/xray/r/xray_image_91.png", None),
            (
                "patient_12/depth/r/orig/depth_cam_right_90.0.png",
                Some("cam_right"),
            ),
            ("patient_0/xray/r/xray_image_91.exr", None),
        ] {
            let (patient, step) = if file.contains("12") {
                (12, 180)
            } else {
                (0, 91)
            };
            let kind = match camera {
                Some(_) => "depth",
                None if file.ends_with(".exr") => "radiograph_tallies",
                None => "radiograph",
            };
            let mut row = json!({
                "file": file, "sha256": sha256_of_file(&tree.path(file)).unwrap(),
                "kind": kind, "patient": patient, "side": "r",
                "step": step, "angle_deg": f64::from(step) / 2.0, "shape": if file.contains("big") { "big" } else { "orig" },
                "patient_from_ct": POSE, "room_from_patient": POSE,
            });
            match camera {
                Some(camera) => row["camera"] = json!(camera),
                None => {
                    row["ct_from_device"] = json!(POSE);
                    row["seed"] = json!(u64::MAX - 1);
                }
            }
            rows += &format!("{row}\n");
        }
        fs::write(tree.path("manifest.jsonl"), rows).unwrap();
        let camera = |view| json!({"view": view, "intrinsics": {"fx": 504.25, "width": 12}, "room_from_camera": POSE});
        let limb = |patient: u32| json!({"patient": patient, "side": "r", "volume_sha256": format!("{patient:064}")});
        let engine = json!({"dose_histories": 2e10, "scatter_histories": 320_000});
        let description = json!({
            "settings": {"generator": "ppa 0.1.0", "code": "0123", "xray": {"engine": engine}},
            "cameras": [camera("cam_left"), camera("cam_right")], "limbs": [limb(0), limb(12)],
        });
        fs::write(tree.path("dataset.json"), description.to_string()).unwrap();
        fs::create_dir(tree.path("splits")).unwrap();
        let split = json!({"version": 1, "parts": {"train": [12], "test": [0]}});
        fs::write(tree.path("splits/mine.json"), split.to_string()).unwrap();
        tree
    }

    pub fn root(&self) -> &Path {
        self.0.path()
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.root().join(name)
    }

    /// Writes a 16-bit image whose pixels increase from `first`.
    pub fn image(&self, name: &str, first: u16) {
        let image = ImageBuffer::from_fn(12, 9, |x, y| Luma([first + x as u16 + 12 * y as u16]));
        let path = self.parent_made(name);
        image.save(path).unwrap();
    }

    pub fn json(&self, name: &str, value: Map<String, Value>) {
        let text = serde_json::to_string_pretty(&value).unwrap();
        fs::write(self.parent_made(name), text).unwrap();
    }

    /// Replaces text in a file.
    pub fn edit(&self, name: &str, from: &str, to: &str) {
        let text = fs::read_to_string(self.path(name)).unwrap();
        assert!(text.contains(from), "{from:?} is not in {name}");
        fs::write(self.path(name), text.replacen(from, to, 1)).unwrap();
    }

    fn parent_made(&self, name: &str) -> PathBuf {
        let path = self.path(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        path
    }
}
