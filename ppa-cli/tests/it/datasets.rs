//! Datasets checked, split and converted with the program.

use std::fs;
use std::path::Path;
use std::sync::OnceLock;

use serde_json::Value;

use crate::{QUICK_DEPTH, contents, fail, names, ppa, succeed, write_plan};

/// A dataset of one limb and five poses in the folder `data`.
fn dataset() -> &'static Path {
    static FOLDER: OnceLock<tempfile::TempDir> = OnceLock::new();
    let folder = FOLDER.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        let shapes = "[shapes]\nvariants = [\"orig\", \"big\"]\n";
        write_plan(folder.path(), &format!("{shapes}{QUICK_DEPTH}"));
        succeed(folder.path(), "generate plan.toml --out data");
        folder
    });
    folder.path()
}

/// A copy of that dataset that may be changed.
fn copy() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes) in contents(&dataset().join("data")) {
        let path = folder.path().join("data").join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, bytes).unwrap();
    }
    folder
}

#[test]
fn a_dataset_is_checked_and_converted_there_and_back() {
    let folder = copy();
    let said = succeed(folder.path(), "dataset check data --json");
    let report: Value = serde_json::from_str(&said).unwrap();
    let count = |key: &str| report[key].as_u64().unwrap();
    assert_eq!(
        (count("patients"), count("pairs"), count("depth_images")),
        (1, 10, 20)
    );
    assert_eq!(
        (count("regions"), count("radiographs"), count("labelled")),
        (20, 5, 0)
    );
    assert_eq!(report["manifest"], true);
    succeed(
        folder.path(),
        "dataset convert data --out specimen --flexion max",
    );
    let said = succeed(
        folder.path(),
        "dataset convert specimen --out back --flexion max --json",
    );
    let report: Value = serde_json::from_str(&said).unwrap();
    assert_eq!(
        (report["depth_images"].as_u64(), report["left_out"].as_u64()),
        (Some(20), Some(0))
    );
    let mut original = contents(&folder.path().join("data"));
    original.retain(|name, _| {
        let tallies = name.extension().is_some_and(|extension| extension == "exr");
        name.starts_with("patient_3") && !tallies
    });
    assert!(contents(&folder.path().join("back")) == original);
    let said = fail(folder.path(), "dataset convert data --out back");
    assert!(said.contains("not an empty folder"), "{said}");
}

#[test]
fn what_was_edited_by_hand_is_reported() {
    let folder = copy();
    let data = folder.path().join("data");
    let image = "patient_3/depth/r/big/depth_cam_left_5.0.png";
    let manifest = fs::read_to_string(data.join("manifest.jsonl")).unwrap();
    let whole = fs::read(data.join(image)).unwrap();
    let said_after = |edit: &dyn Fn()| {
        edit();
        let said = fail(folder.path(), "dataset check data");
        fs::write(data.join("manifest.jsonl"), &manifest).unwrap();
        fs::write(data.join(image), &whole).unwrap();
        said
    };
    let edited = |from: &str, to: &str| {
        assert!(manifest.contains(from));
        fs::write(data.join("manifest.jsonl"), manifest.replacen(from, to, 1)).unwrap();
    };
    let other = data.join("patient_3/depth/r/orig/depth_cam_left_5.0.png");
    let first_row = manifest.lines().next().unwrap().to_owned() + "\n";
    for (edit, parts) in [
        (
            &(|| fs::write(data.join(image), &whole[..99]).unwrap()) as &dyn Fn(),
            [image, "not a complete PNG file"],
        ),
        (
            &|| fs::write(data.join(image), fs::read(&other).unwrap()).unwrap(),
            [image, "is altered"],
        ),
        (
            &|| edited("\"angle_deg\":2.5", "\"angle_deg\":2.4"),
            ["manifest.jsonl", "half of step 5"],
        ),
        (
            &|| edited("\"step\":5", "\"step\":"),
            ["manifest.jsonl", "expected value"],
        ),
        (
            &|| edited(&first_row, ""),
            ["depth_cam_left_0.0.png", "not listed in manifest.jsonl"],
        ),
        (
            &|| edited(&first_row, &first_row.repeat(2)),
            ["depth_cam_left_0.0.png", "twice"],
        ),
    ] {
        let said = said_after(edit);
        assert!(parts.iter().all(|part| said.contains(part)), "{said}");
    }
    succeed(folder.path(), "dataset check data");
}

#[test]
fn persons_are_split_and_leaks_refused() {
    let folder = copy();
    let data = folder.path().join("data");
    let said = fail(folder.path(), "dataset split data");
    assert!(
        said.contains("with 1 person the part val is empty"),
        "{said}"
    );
    succeed(folder.path(), "dataset split data --part train=1");
    // Repeating the same split is allowed.
    succeed(folder.path(), "dataset split data --part train=1");
    let path = data.join("splits/default.json");
    let split: Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    assert_eq!(split["parts"]["train"], serde_json::json!([3]));
    let said = succeed(folder.path(), "dataset check data");
    assert!(said.contains("splits by person: default"), "{said}");
    let leak = r#"{"version": 1, "parts": {"train": [3], "test": [3]}}"#;
    fs::write(&path, leak).unwrap();
    let said = fail(folder.path(), "dataset check data");
    for part in ["default.json", "patient 3 is in test and in train"] {
        assert!(said.contains(part), "{said}");
    }
    for (command, part) in [
        ("dataset split data --name ../x", "--name"),
        (
            "dataset split data --part train=1 --seed 1",
            "give --replace",
        ),
    ] {
        let said = fail(folder.path(), command);
        assert!(said.contains(part), "{said}");
    }
    assert_eq!(names(&data.join("splits")), ["default.json"]);
}

#[test]
fn tables_and_archives_are_written_from_a_generated_dataset() {
    let folder = copy();
    let said = succeed(folder.path(), "export table data --out manifest.csv --json");
    // Five poses: four depth images, a radiograph and its tallies.
    assert_eq!(serde_json::from_str::<Value>(&said).unwrap()["rows"], 30);
    let csv = fs::read_to_string(folder.path().join("manifest.csv")).unwrap();
    let mut rows = csv::Reader::from_reader(csv.as_bytes());
    let header = rows.headers().unwrap().clone();
    let at = |name: &str| header.iter().position(|column| column == name).unwrap();
    for row in rows.records().map(Result::unwrap) {
        let is_depth = &row[at("kind")] == "depth";
        assert_eq!(row[at("intrinsics")].contains("\"fx\""), is_depth);
        assert_eq!(&row[at("scatter_histories")] == "100", !is_depth);
    }
    let metadata = "export metadata data --name ankle --license https://example.org/licence --date";
    let said = ppa(folder.path(), &format!("{metadata} 2026-13-01"))
        .output()
        .unwrap();
    assert!(String::from_utf8_lossy(&said.stderr).contains("YYYY-MM-DD"));
    succeed(folder.path(), &format!("{metadata} 2026-11-21"));
    succeed(folder.path(), &format!("{metadata} 2026-11-21"));
    let croissant = folder.path().join("data/croissant.json");
    let made = fs::read(&croissant).unwrap();
    let refused = fail(folder.path(), &format!("{metadata} 2026-11-22"));
    assert!(
        refused.contains("croissant.json exists and differs"),
        "{refused}"
    );
    assert_eq!(fs::read(&croissant).unwrap(), made);
    succeed(folder.path(), "dataset check data");
    succeed(
        folder.path(),
        "export webdataset data --out shards --per-shard 4",
    );
    assert_eq!(
        names(&folder.path().join("shards")),
        ["all-000000.tar", "all-000001.tar", "all-000002.tar"]
    );
    succeed(folder.path(), "export bagit data --out bag");
    let images = |root: &Path| {
        let mut files = contents(root);
        files.retain(|name, _| !name.starts_with(".ppa"));
        files
    };
    assert!(contents(&folder.path().join("bag/data")) == images(&folder.path().join("data")));
    if cfg!(feature = "parquet") {
        succeed(folder.path(), "export table data --out t.parquet");
        let bytes = fs::read(folder.path().join("t.parquet")).unwrap();
        assert!(bytes.starts_with(b"PAR1") && bytes.ends_with(b"PAR1"));
    } else {
        let said = fail(folder.path(), "export table data --out t.parquet");
        assert!(said.contains("the feature parquet"), "{said}");
    }
    let said = fail(folder.path(), "export table specimen --out t.csv");
    assert!(said.contains("manifest.jsonl"), "{said}");
}

/// The page loads nothing from elsewhere and does not reveal the location of the dataset.
#[test]
fn the_page_of_a_dataset_stands_by_itself() {
    let folder = copy();
    succeed(folder.path(), "qa data");
    let page = fs::read_to_string(folder.path().join("data/qa.html")).unwrap();
    for outside in [
        "http:", "https:", "//", "url(", "<script", "<link", "@import", "/tmp",
    ] {
        let text = page
            .split("data:image/png;base64,")
            .map(|part| part.split_once('"').map_or(part, |(_, rest)| rest));
        for part in text {
            assert!(
                !part.contains(outside),
                "{outside}: {}",
                part.chars().take(300).collect::<String>()
            );
        }
    }
    // Rows of both cameras and of radiographs, and three poses of two cameras.
    let rows = ["orig left", "orig right", "big left", "radiograph"];
    assert_eq!(page.matches("src=\"data:image/png").count(), rows.len() + 6);
    for row in rows {
        assert!(page.contains(&format!("<tr><th>{row}</th>")), "{row}");
    }
    assert!(page.contains("aria-label=\"colours of depths from "));
    assert!(page.contains("Fewer than 9 poses") && page.contains("matches manifest.jsonl"));
    // Damaged images are reported and shown as a cross; the page is still written.
    let images = [
        "patient_3/depth/r/orig/depth_cam_left_0.0.png",
        "patient_3/xray/r/xray_image_0.png",
    ];
    for image in images {
        let path = folder.path().join("data").join(image);
        fs::write(&path, &fs::read(&path).unwrap()[..100]).unwrap();
    }
    succeed(folder.path(), "qa data --out other.html");
    let page = fs::read_to_string(folder.path().join("other.html")).unwrap();
    for image in images {
        assert!(page.contains(&format!("{image} is not a complete PNG file")));
    }
    assert_eq!(page.matches("src=\"data:image/png").count(), rows.len() + 5);
    assert!(page.contains("verdict bad") && !page.contains("\"verdict good"));
    fs::remove_file(folder.path().join("data/manifest.jsonl")).unwrap();
    let said = fail(folder.path(), "qa data --out third.html");
    assert!(
        said.contains("manifest.jsonl: `ppa generate` and `ppa merge` write it"),
        "{said}"
    );
    assert!(!folder.path().join("third.html").exists());
    assert!(page.contains("cannot be read"));
    assert!(!page.contains("/tmp"));
}
