//! Tables and metadata of a dataset, read back.

use std::collections::BTreeMap;
use std::fs;

use ppa_dataset::export::{Metadata, Table, write_metadata};
use ppa_dataset::published::{Flaw, inspect};
use ppa_dataset::sha256_of_file;
use serde_json::Value;

use crate::trees::{POSE, Tree};

/// Rows of a CSV file by column name, parsed by hand: none of our cells contains a line break.
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
    let tree = Tree::generated();
    let table = Table::of_dataset(tree.root(), Some("mine")).unwrap();
    assert_eq!((table.rows(), table.columns.len()), (4, 22));
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
    assert_eq!(cell(3, "kind"), "radiograph_tallies");
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

    let tree = Tree::generated();
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
    let tree = Tree::generated();
    let metadata = Metadata {
        name: "two limbs".to_owned(),
        license: "https://creativecommons.org/licenses/by/4.0/".to_owned(),
        date: "2026-11-21".to_owned(),
    };
    write_metadata(tree.root(), &metadata, None, false).unwrap();
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
    // Without this context, the term would belong to no vocabulary.
    assert_eq!(
        ro_crate["@context"][1]["sha256"],
        "https://schema.org/sha256"
    );
    let graph = ro_crate["@graph"].as_array().unwrap();
    for list in [
        "patient_0/labels/r/labels.json",
        "patient_0/labels/r/roi_depth.json",
        "splits/mine.json",
        "croissant.json",
        "datasheet.md",
    ] {
        assert!(graph.iter().any(|entity| entity["@id"] == list), "{list}");
    }
    for part in graph[1]["hasPart"].as_array().unwrap() {
        let id = part["@id"].as_str().unwrap();
        assert!(tree.path(id).is_file(), "{id}");
        assert_eq!(
            graph.iter().filter(|entity| entity["@id"] == id).count(),
            1,
            "{id}"
        );
    }
    let sheet = fs::read_to_string(tree.path("datasheet.md")).unwrap();
    for report in [
        "# Datasheet of two limbs",
        "2 persons, 2 limbs, 2 poses; files: 2 depth, 1 radiograph, 1 radiograph_tallies.",
        "Depth images by body shape: 1 big, 1 orig.",
        "by source: 1 an unnamed source.",
        "Recommended splits are in the folder `splits`: mine.",
        "ppa 0.1.0 (sources 0123) from 2 volumes",
        "**To answer:** Who made it",
    ] {
        assert!(sheet.contains(report), "{report}: {sheet}");
    }
    // People's answers are kept.
    let answered = sheet.replace("**To answer:** Who made it", "A university made it");
    fs::write(tree.path("datasheet.md"), &answered).unwrap();
    let files = write_metadata(tree.root(), &metadata, None, false).unwrap();
    assert_eq!(files[3], "datasheet.new.md");
    let read = |name: &str| fs::read_to_string(tree.path(name)).unwrap();
    assert_eq!([read("datasheet.md"), read(files[3])], [answered, sheet]);
    // Existing files that differ are overwritten only on request.
    let table = tree.path("manifest.csv");
    let csv = fs::read(&table).unwrap();
    fs::write(&table, "edited").unwrap();
    let refused = write_metadata(tree.root(), &metadata, None, false).unwrap_err();
    assert!(
        refused
            .to_string()
            .contains("manifest.csv exists and differs"),
        "{refused}"
    );
    assert_eq!(fs::read(&table).unwrap(), b"edited");
    write_metadata(tree.root(), &metadata, None, true).unwrap();
    assert_eq!(fs::read(&table).unwrap(), csv);
    // Metadata are outdated once the table changes.
    let stale = |tree: &Tree| {
        let found = inspect(tree.root()).unwrap().flaws;
        found.iter().any(|flaw| matches!(flaw, Flaw::Metadata(_)))
    };
    assert!(!stale(&tree));
    let table = Table::of_dataset(tree.root(), Some("mine")).unwrap();
    table.write(&tree.path("manifest.csv")).unwrap();
    assert!(stale(&tree));
}

#[test]
fn invalid_metadata_and_foreign_labels_are_refused() {
    let tree = Tree::generated();
    let metadata = Metadata {
        name: "two limbs".to_owned(),
        license: "https://creativecommons.org/licenses/by/4.0/".to_owned(),
        date: "2026-02-29".to_owned(),
    };
    let refused = write_metadata(tree.root(), &metadata, None, false).unwrap_err();
    assert!(refused.to_string().contains("2026-02-29"), "{refused}");
    let other = "\"radiograph_sha256\": \"0123\", \"step\": 91";
    tree.edit("patient_0/labels/r/labels.json", "\"step\": 91", other);
    let date = "2024-02-29".to_owned();
    let metadata = Metadata { date, ..metadata };
    let refused = write_metadata(tree.root(), &metadata, None, false).unwrap_err();
    assert!(
        refused.to_string().contains("the label of step 91"),
        "{refused}"
    );
    for name in ["manifest.csv", "croissant.json", "ro-crate-metadata.json"] {
        assert!(!tree.path(name).exists(), "{name}");
    }
}
