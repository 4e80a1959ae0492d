//! A dataset of limbs with soft tissue flattened by the table.

use std::fs;
use std::path::Path;

use ppa_depth::DepthImage;
use serde_json::Value;

use crate::{succeed, write_plan};

/// Rows of the manifest at the first angle, and the left camera's image of the `orig` shape.
fn generated(folder: &Path, more: &str) -> (Vec<Value>, DepthImage) {
    let few = "[shapes]\nvariants = [\"orig\", \"big\"]\n";
    write_plan(folder, &format!("{few}{more}"));
    succeed(folder, "generate plan.toml --out data --progress quiet");
    succeed(folder, "verify data --plan plan.toml --fraction 1");
    let manifest = fs::read_to_string(folder.join("data/manifest.jsonl")).unwrap();
    let rows = manifest
        .lines()
        .map(|line| serde_json::from_str::<Value>(line).unwrap());
    let rows: Vec<Value> = rows.filter(|row| row["step"] == 0).collect();
    let left = |row: &&Value| row["camera"] == "cam_left" && row["shape"] == "orig";
    let file = rows.iter().find(left).unwrap()["file"].as_str().unwrap();
    let image = DepthImage::read_png(&folder.join("data").join(file)).unwrap();
    (rows, image)
}

#[test]
fn a_dataset_with_soft_tissue_lies_lower_and_is_recorded() {
    let [rigid, soft] = ["", "[soft_tissue]\ndistal_mm = 4.0\nproximal_mm = 4.0\n"].map(|more| {
        let folder = tempfile::tempdir().unwrap();
        let (rows, image) = generated(folder.path(), more);
        let text = fs::read_to_string(folder.path().join("data/dataset.json")).unwrap();
        let dataset: Value = serde_json::from_str(&text).unwrap();
        (rows, image, dataset["settings"]["soft_tissue"].clone())
    });
    assert_eq!(rigid.2["distal_mm"], 0.0);
    assert_eq!(soft.2["distal_mm"], 4.0);
    // Both ends sink by 4 mm, as does everything that is not pressed against the table.
    let height = |rows: &[Value]| rows[0]["room_from_patient"][2][3].as_f64().unwrap();
    assert!((height(&rigid.0) - height(&soft.0) - 4.0).abs() < 0.5);
    let lower = |(a, b): (&f32, &f32)| *a > 0.0 && *b > 0.0 && b - a > 2.0;
    let pairs = || rigid.1.z_mm.iter().zip(&soft.1.z_mm);
    assert!(pairs().filter(|pair| lower(*pair)).count() > 1000);
    // The manifest gives the volume change of a body shape, for its images only.
    for row in &rigid.0 {
        let change = row["volume_change_mm3"].as_f64();
        let of_big = row["kind"] == "depth" && row["shape"] == "big";
        assert_eq!(change.is_some_and(|mm3| mm3 > 1e5), of_big, "{row}");
        assert!(row.get("too_far_pixels").is_none(), "{row}");
    }
}
