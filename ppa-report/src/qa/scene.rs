//! Cameras and origin as stated in `dataset.json`.

use std::path::Path;

use nalgebra::{Isometry3, Point3};
use ppa_core::TransformRows;
use ppa_dataset::files::{FileError, read_text};
use ppa_dataset::layout::View;
use ppa_dataset::manifest::FileRow;
use ppa_depth::{Camera, CameraSpec, isometry_from_rows};
use serde::Deserialize;

use super::error::QaError;

#[derive(Deserialize)]
struct Described {
    settings: Settings,
    table: Table,
    cameras: Vec<CameraRow>,
    limbs: Vec<Limb>,
}

#[derive(Deserialize)]
struct Settings {
    generator: String,
    code: String,
    seed: u64,
}

/// The plane that limbs lie on, in the room: points p with n·p = offset.
#[derive(Deserialize)]
struct Table {
    normal: [f64; 3],
    offset_mm: f64,
}

#[derive(Deserialize)]
struct CameraRow {
    view: View,
    intrinsics: CameraSpec,
    room_from_camera: TransformRows,
}

/// One scan of the dataset.
#[derive(Deserialize)]
pub(super) struct Limb {
    pub patient: u32,
    pub side: String,
    pub volume_sha256: String,
}

/// Cameras in their room, and the origin of the images.
pub(super) struct Scene {
    pub generator: String,
    pub code: String,
    pub seed: u64,
    pub limbs: Vec<Limb>,
    table: Table,
    cameras: Vec<(View, Camera, Isometry3<f64>)>,
}

impl Scene {
    pub fn read(root: &Path) -> Result<Self, QaError> {
        let path = root.join("dataset.json");
        let wrong = |error: String| FileError::at("use", &path)(std::io::Error::other(error));
        let described: Described = serde_json::from_str(&read_text(&path)?)
            .map_err(|e| FileError::at("parse", &path)(e.into()))?;
        let mut cameras = Vec::new();
        for row in described.cameras {
            let camera = Camera::try_from(row.intrinsics).map_err(|e| wrong(e.to_string()))?;
            let pose =
                isometry_from_rows(&row.room_from_camera).map_err(|e| wrong(e.to_string()))?;
            cameras.push((row.view, camera, pose.inverse()));
        }
        Ok(Self {
            generator: described.settings.generator,
            code: described.settings.code,
            seed: described.settings.seed,
            limbs: described.limbs,
            table: described.table,
            cameras,
        })
    }

    /// Pixel onto which the joint (the patient frame's origin) is projected in a depth image; `None` outside the lens' field.
    pub fn joint_pixel(&self, row: &FileRow) -> Option<[f64; 2]> {
        let (_, camera, camera_from_room) = self
            .cameras
            .iter()
            .find(|(view, ..)| Some(*view) == row.camera)?;
        let pose = row.room_from_patient;
        let joint = Point3::new(pose[0][3], pose[1][3], pose[2][3]);
        let pixel = camera.project(&(camera_from_room * joint))?;
        Some([pixel.x, pixel.y])
    }

    /// Height of the joint above the table, mm, and angle of the limb's axis away from it, degrees. A recorded room may have any
    /// frame: only the table determines the upward direction.
    pub fn height_and_tilt(&self, row: &FileRow) -> [f64; 2] {
        let pose = row.room_from_patient;
        let up = |column: usize| -> f64 {
            let normal = self.table.normal.iter();
            normal.zip(&pose).map(|(n, row)| n * row[column]).sum()
        };
        let tilt = up(2).clamp(-1.0, 1.0).asin();
        [up(3) - self.table.offset_mm, tilt.to_degrees()]
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    const ROOM_FROM_PATIENT: TransformRows = [
        [0.0, -1.0, 0.0, 30.0],
        [0.6, 0.0, 0.8, -20.0],
        [-0.8, 0.0, 0.6, 110.0],
        [0.0, 0.0, 0.0, 1.0],
    ];

    fn row(camera: &str) -> FileRow {
        let row = json!({
            "file": "", "sha256": "", "kind": "depth", "patient": 0, "side": "l", "step": 0, "angle_deg": 0.0,
            "camera": camera, "shape": "orig", "patient_from_ct": ROOM_FROM_PATIENT, "room_from_patient": ROOM_FROM_PATIENT,
        });
        serde_json::from_value(row).unwrap()
    }

    /// A pinhole camera 1000 mm above the room's origin that looks down: x as the room's, y against it.
    #[test]
    fn the_joint_falls_where_a_pinhole_puts_it() {
        let folder = tempfile::tempdir().unwrap();
        let down = [
            [1.0, 0.0, 0.0, 0.0],
            [0.0, -1.0, 0.0, 0.0],
            [0.0, 0.0, -1.0, 1000.0],
            [0.0, 0.0, 0.0, 1.0],
        ];
        let lens = json!({"model": "pinhole", "width": 320, "height": 288, "fx": 250.0, "fy": 260.0, "cx": 160.0, "cy": 140.0});
        let described = json!({
            "settings": {"generator": "ppa 0", "code": "0", "seed": 3}, "limbs": [],
            "table": {"normal": [0.0, 0.0, 1.0], "offset_mm": 0.0},
            "cameras": [{"view": "cam_left", "intrinsics": lens, "room_from_camera": down}],
        });
        std::fs::write(folder.path().join("dataset.json"), described.to_string()).unwrap();
        let scene = Scene::read(folder.path()).unwrap();
        // The joint is 1000 − 110 = 890 mm below the camera.
        let [u, v] = scene.joint_pixel(&row("cam_left")).unwrap();
        assert!((u - (160.0 + 250.0 * 30.0 / 890.0)).abs() < 1e-9, "{u}");
        assert!((v - (140.0 + 260.0 * 20.0 / 890.0)).abs() < 1e-9, "{v}");
        assert_eq!(scene.joint_pixel(&row("cam_right")), None);
    }

    #[test]
    fn an_axis_that_rises_by_three_fifths_tilts_by_37_degrees() {
        let scene = |normal: [f64; 3], offset_mm: f64| Scene {
            generator: String::new(),
            code: String::new(),
            seed: 0,
            limbs: Vec::new(),
            table: Table { normal, offset_mm },
            cameras: Vec::new(),
        };
        let [height_mm, tilt_deg] = scene([0.0, 0.0, 1.0], 30.0).height_and_tilt(&row("cam_left"));
        assert_eq!(height_mm, 80.0);
        assert!((tilt_deg - 36.869_897_645_844).abs() < 1e-9);
        // A room recorded with y upwards: the joint at y = -20 over a table at y = -120, the axis rising by four fifths.
        let [height_mm, tilt_deg] =
            scene([0.0, 1.0, 0.0], -120.0).height_and_tilt(&row("cam_left"));
        assert_eq!(height_mm, 100.0);
        assert!((tilt_deg - 53.130_102_354_156).abs() < 1e-9);
    }
}
