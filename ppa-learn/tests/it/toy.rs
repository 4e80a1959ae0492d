//! A dataset of rotated bars, made by a formula.

use std::fs;
use std::path::Path;

use tempfile::TempDir;

/// Columns and rows of the images.
pub const IMAGE: u32 = 60;

/// Writes a 16-bit PNG.
pub fn png(path: &Path, side: u32, value: impl Fn(u32, u32) -> u16) {
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    image::ImageBuffer::from_fn(side, side, |x, y| image::Luma([value(x, y)]))
        .save(path)
        .unwrap();
}

/// Depth of a bar 500 mm in front of a wall, rotated by the angle about the centre of the region; every person's bar has its own
/// width and position.
fn bar(x: u32, y: u32, angle_deg: f64, patient: u32) -> u16 {
    let shift = f64::from(patient % 3) - 1.0;
    let (x, y) = (f64::from(x) - 34.0 - shift, f64::from(y) - 29.0 + shift);
    let (sin, cos) = angle_deg.to_radians().sin_cos();
    let (along, across) = (cos * x + sin * y, cos * y - sin * x);
    let half_width = 4.0 + 0.4 * f64::from(patient);
    match along.abs() < 18.0 && across.abs() < half_width {
        true => 700,
        false => 1200,
    }
}

/// Right feet of persons in the synthetic layout, with poses at the given steps and labels from 1 (0 degrees) to 3 (90).
pub fn dataset(patients: u32, steps: &[u32]) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for patient in 0..patients {
        let root = folder.path().join(format!("patient_{patient}"));
        let mut labels = serde_json::Map::new();
        let mut rois = serde_json::Map::new();
        for &step in steps {
            let angle = f64::from(step) / 2.0;
            for view in ["left", "right"] {
                let name = format!("depth_cam_{view}_{angle:.1}.png");
                let path = root.join("depth/r/orig").join(&name);
                png(&path, IMAGE, |x, y| bar(x, y, angle, patient));
                let roi = serde_json::json!({
                    "camera": format!("cam_{view}"), "image_number": step, "x_start": 10, "y_start": 5, "size": 48
                });
                rois.insert(name, roi);
            }
            let label = 1.0 + angle / 45.0;
            let entry = serde_json::json!({"label": label, "std": 0.0, "step": step});
            labels.insert(format!("xray_image_{step}.png"), entry);
        }
        let folder = root.join("labels/r");
        fs::create_dir_all(&folder).unwrap();
        for (name, entries) in [("labels.json", labels), ("roi_depth.json", rois)] {
            let text = serde_json::to_string(&entries).unwrap();
            fs::write(folder.join(name), text).unwrap();
        }
    }
    folder
}
