//! Tables and archives of a dataset, read back.

use std::collections::BTreeMap;
use std::fs;
use std::io::Read;
use std::path::Path;

use ppa_dataset::export::{Metadata, Shards, Table, bag, web_dataset, write_metadata};
use ppa_dataset::sha256_of_file;
use serde_json::{Value, json};

use crate::trees::Tree;

const POSE: [[f64; 4]; 4] = [
    [1.0, 0.0, 0.0, 0.1 + 0.2],
    [0.0, 1.0, 0.0, -7.25],
    [0.0, 0.0, 1.0, 1e-17],
    [0.0, 0.0, 0.0, 1.0],
];

/// The synthetic tree with the lists that `ppa generate` writes, as far as exports look at them.
fn generated() -> Tree {
    let tree = Tree::synthetic();
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
    ] {
        let (patient, step) = if file.contains("12") {
            (12, 180)
        } else {
            (0, 91)
        };
        let mut row = json!({
            "file": file, "sha256": sha256_of_file(&tree.path(file)).unwrap(),
            "kind": if camera.is_some() { "depth" } else { "radiograph" }, "patient": patient, "side": "r",
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

/// Rows of a CSV file by column name, read by hand: no cell of ours holds a line break.
fn csv_rows(text: &str) -> Vec<BTreeMap<String, String>> {
    let cells = |line: &str| {
        let (mut cells, mut quoted) = (vec![String::new()], false);
        for part in line.split('"') {
            if quoted {
                cells.last_mut().unwrap().push_str(part);
            } else {
                let mut parts = part.split(',');
                cells.last_mut().unwrap().push_str(parts.next().unwrap());
                cells.extend(parts.map(str::to_owned));
            }
            quoted = !quoted;
        }
        cells
    };
    let mut lines = text.lines().map(|line| cells(&line.replace("\"\"", "'")));
    let header = lines.next().unwrap();
    lines
        .map(|line| header.iter().cloned().zip(line).collect())
        .collect()
}

#[test]
fn the_table_has_a_row_per_file_with_all_that_is_known() {
    let tree = generated();
    let table = Table::of_dataset(tree.root(), Some("mine")).unwrap();
    assert_eq!((table.rows(), table.columns.len()), (3, 22));
    let path = tree.path("table.csv");
    table.write(&path).unwrap();
    let rows = csv_rows(&fs::read_to_string(&path).unwrap());
    let cell = |row: usize, name: &str| rows[row][name].as_str();
    let of = |row, names: &[&str]| {
        names
            .iter()
            .map(|name| cell(row, name).to_owned())
            .collect::<Vec<_>>()
    };
    let names = [
        "kind",
        "unit",
        "patient",
        "side",
        "step",
        "angle_deg",
        "camera",
        "shape",
        "seed",
        "scatter_histories",
    ];
    assert_eq!(
        of(0, &names),
        [
            "depth",
            "patient_0_r_091",
            "0",
            "r",
            "91",
            "45.5",
            "cam_left",
            "big",
            "",
            ""
        ]
    );
    let seed = (u64::MAX - 1).to_string();
    assert_eq!(
        of(1, &names),
        [
            "radiograph",
            "patient_0_r_091",
            "0",
            "r",
            "91",
            "45.5",
            "",
            "orig",
            &seed,
            "320000"
        ]
    );
    assert_eq!(
        of(
            1,
            &[
                "dose_histories",
                "label",
                "label_std",
                "label_source",
                "split"
            ]
        ),
        ["20000000000", "2.5", "0.5", "", "test"]
    );
    assert_eq!(
        of(2, &["unit", "label", "split"]),
        ["patient_12_r_180", "", "train"]
    );
    assert_eq!(cell(0, "intrinsics"), "{'fx':504.25,'width':12}");
    let pose: [[f64; 4]; 4] = serde_json::from_str(cell(1, "ct_from_device")).unwrap();
    assert_eq!(pose, POSE);
    assert_eq!(
        (cell(0, "ct_from_device"), cell(1, "room_from_camera")),
        ("", "")
    );
    let error = table.write(&tree.path("table.xlsx")).unwrap_err();
    assert!(
        std::error::Error::source(&error)
            .unwrap()
            .to_string()
            .contains(".csv")
    );
    assert!(!tree.path("table.xlsx").exists());
}

/// Read back by the library that wrote it.
#[cfg(feature = "parquet")]
#[test]
fn parquet_holds_the_same_table() {
    use parquet::file::reader::{FileReader, SerializedFileReader};
    use parquet::record::Field;

    let tree = generated();
    let table = Table::of_dataset(tree.root(), Some("mine")).unwrap();
    let path = tree.path("table.parquet");
    table.write(&path).unwrap();
    let reader = SerializedFileReader::new(fs::File::open(&path).unwrap()).unwrap();
    let read: Vec<_> = reader
        .get_row_iter(None)
        .unwrap()
        .map(Result::unwrap)
        .collect();
    let rows = csv_rows(std::str::from_utf8(&table.to_csv()).unwrap());
    assert_eq!(read.len(), rows.len());
    for (read, row) in read.iter().zip(&rows) {
        for (name, field) in read.get_column_iter() {
            let text = match field {
                Field::Null => String::new(),
                Field::Str(text) => text.replace('"', "'"),
                Field::ULong(count) => count.to_string(),
                Field::Double(number) => number.to_string(),
                other => panic!("{name} is {other:?}"),
            };
            assert_eq!(text, row[name], "{name}");
        }
    }
}

#[test]
fn metadata_describe_the_table_that_is_there() {
    let tree = generated();
    let metadata = Metadata {
        name: "two limbs".to_owned(),
        license: "https://creativecommons.org/licenses/by/4.0/".to_owned(),
        date: "2026-11-21".to_owned(),
    };
    write_metadata(tree.root(), &metadata, None).unwrap();
    let json = |name: &str| -> Value {
        serde_json::from_slice(&fs::read(tree.path(name)).unwrap()).unwrap()
    };
    let croissant = json("croissant.json");
    let table = &croissant["distribution"][0];
    assert_eq!(
        table["sha256"],
        sha256_of_file(&tree.path("manifest.csv")).unwrap()
    );
    let fields = croissant["recordSet"][0]["field"].as_array().unwrap();
    let header = fs::read_to_string(tree.path("manifest.csv")).unwrap();
    let names: Vec<_> = fields
        .iter()
        .map(|field| field["name"].as_str().unwrap())
        .collect();
    assert_eq!(names.join(","), header.lines().next().unwrap());
    let ro_crate = json("ro-crate-metadata.json");
    let graph = ro_crate["@graph"].as_array().unwrap();
    for part in graph[1]["hasPart"].as_array().unwrap() {
        let id = part["@id"].as_str().unwrap();
        assert!(tree.path(id).is_file(), "{id}");
        assert_eq!(
            graph.iter().filter(|entity| entity["@id"] == id).count(),
            1,
            "{id}"
        );
    }
}

#[test]
fn a_bag_holds_every_file_but_hidden_ones_with_its_hash() {
    let tree = generated();
    fs::create_dir(tree.path(".ppa")).unwrap();
    fs::write(tree.path(".ppa/record.json"), "{}").unwrap();
    fs::write(tree.path("100 %.txt"), "odd name").unwrap();
    let folder = tempfile::tempdir().unwrap();
    let to = folder.path().join("bag");
    let made = bag(tree.root(), &to).unwrap();
    let manifest = fs::read_to_string(to.join("manifest-sha256.txt")).unwrap();
    let mut bytes = 0;
    for line in manifest.lines() {
        let (hash, name) = line.split_once("  ").unwrap();
        let path = to.join(name.replace("%25", "%"));
        assert_eq!(sha256_of_file(&path).unwrap(), hash);
        bytes += fs::metadata(path).unwrap().len();
    }
    assert_eq!(
        (manifest.lines().count() as u64, bytes),
        (made.files, made.bytes)
    );
    assert!(manifest.contains("data/100 %25.txt") && !manifest.contains(".ppa"));
    // 24 depth images, 4 radiographs, 4 lists of labels and regions, manifest, description, split, odd name.
    assert_eq!(made.files, 24 + 4 + 4 + 4);
    let tags = fs::read_to_string(to.join("tagmanifest-sha256.txt")).unwrap();
    for line in tags.lines() {
        let (hash, name) = line.split_once("  ").unwrap();
        assert_eq!(sha256_of_file(&to.join(name)).unwrap(), hash);
    }
    assert!(bag(tree.root(), &to).is_err(), "a bag is not written over");
}

/// Names and bytes of the files of an archive, in their order.
fn archived(path: &Path) -> Vec<(String, Vec<u8>)> {
    let mut archive = tar::Archive::new(fs::File::open(path).unwrap());
    let entries = archive.entries().unwrap().map(|entry| {
        let mut entry = entry.unwrap();
        let mut bytes = Vec::new();
        entry.read_to_end(&mut bytes).unwrap();
        (entry.path().unwrap().to_str().unwrap().to_owned(), bytes)
    });
    entries.collect()
}

#[test]
fn archives_hold_the_samples_of_one_part_in_order() {
    let tree = generated();
    let folder = tempfile::tempdir().unwrap();
    let [to, again] = ["shards", "again"].map(|name| folder.path().join(name));
    let made = web_dataset(tree.root(), &to, 3, Some("mine")).unwrap();
    // Person 0: 8 pairs, person 12: 4.
    assert_eq!(
        made,
        Shards {
            shards: 3 + 2,
            samples: 12
        }
    );
    let first = archived(&to.join("test-000000.tar"));
    let names: Vec<_> = first.iter().map(|(name, _)| name.as_str()).collect();
    let of_sample = ["left.png", "right.png", "xray.png", "json"];
    assert_eq!(
        names[..4],
        of_sample.map(|kind| format!("patient_0_l_091_orig.{kind}"))
    );
    assert_eq!(
        first[1].1,
        fs::read(tree.path("patient_0/depth/l/orig/depth_cam_right_45.5.png")).unwrap()
    );
    let row: Value = serde_json::from_slice(&first[3].1).unwrap();
    assert_eq!(
        (
            row["label"]["label"].as_f64(),
            row["right"]["roi"]["size"].as_u64()
        ),
        (Some(2.5), Some(5))
    );
    let train: Vec<_> = (0..2)
        .flat_map(|i| archived(&to.join(format!("train-{i:06}.tar"))))
        .collect();
    assert_eq!(train.len(), 4 * 3);
    assert!(
        train
            .iter()
            .all(|(name, _)| name.starts_with("patient_12_r_"))
    );
    web_dataset(tree.root(), &again, 3, Some("mine")).unwrap();
    for name in ["test-000002.tar", "train-000001.tar"] {
        assert!(fs::read(to.join(name)).unwrap() == fs::read(again.join(name)).unwrap());
    }
    let specimen = Tree::specimen();
    let made = web_dataset(specimen.root(), &folder.path().join("specimen"), 1000, None).unwrap();
    assert_eq!(
        made,
        Shards {
            shards: 1,
            samples: 36
        }
    );
}
