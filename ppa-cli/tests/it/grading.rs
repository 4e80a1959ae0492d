//! From a dataset to readers and back: the page they get, and the labels made from their grades.

use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::shards::write_quick_plan;
use crate::{fail, names, ppa, succeed};

/// A folder with a dataset of five radiographs, `data`, exported to `out`.
fn exported() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    write_quick_plan(folder.path());
    succeed(folder.path(), "generate plan.toml --out data");
    succeed(folder.path(), "label export data --out out/");
    folder
}

/// Rows of the key: name, image, sha256.
fn key(folder: &Path) -> Vec<[String; 3]> {
    let key = fs::read_to_string(folder.join("out.key.csv")).unwrap();
    let mut lines = key.lines();
    assert_eq!(lines.next(), Some("name,image,sha256"));
    let cells = |line: &str| line.split(',').map(str::to_owned).collect::<Vec<_>>();
    lines.map(|line| cells(line).try_into().unwrap()).collect()
}

/// Writes the file that a page saves when a reader gives the nth picture the nth grade.
fn grade(folder: &Path, reader: &str, grades: &[f64]) {
    let mut csv = "image,reader,grade\n".to_owned();
    for ([name, ..], grade) in key(folder).iter().zip(grades) {
        csv += &format!("{name},\"{reader}\",{grade}\n");
    }
    fs::write(folder.join(format!("{reader}.csv")), csv).unwrap();
}

fn labels(folder: &Path) -> Value {
    let path = folder.join("data/patient_3/labels/r/labels.json");
    serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap()
}

fn file_name(image: &str) -> &str {
    image.rsplit('/').next().unwrap()
}

#[test]
fn readers_get_pictures_without_a_trace_of_what_they_show() {
    let folder = exported();
    let here = folder.path();
    assert_eq!(names(&here.join("out")), ["grading.html"]);
    let page = fs::read_to_string(here.join("out/grading.html")).unwrap();
    for trace in ["patient", "xray_image", "http", "src=\"", "5.0"] {
        assert!(!page.contains(trace), "the page contains {trace}");
    }
    let key = key(here);
    assert_eq!(key.len(), 6, "five radiographs, one of them twice");
    for [name, image, sha256] in &key {
        assert!(page.contains(&format!("{{\"name\":\"{name}\",\"png\":\"")));
        assert!(!page.contains(image) && !page.contains(sha256));
    }
    let refused = fail(here, "label export data --out o2 --key o2/key.csv");
    assert!(refused.contains("would be in the folder for readers"));
    assert!(!here.join("o2").exists());
    let refused = fail(here, "label export data --out o2 --every-deg 0.7");
    assert!(refused.contains("--every-deg is 0.7"), "{refused}");
    let refused = fail(here, "label export nowhere --out o2");
    assert!(refused.contains("nowhere"), "{refused}");
}

#[test]
fn grades_become_labels_and_are_kept() {
    let folder = exported();
    let here = folder.path();
    let key = key(here);
    let again = (0..key.len())
        .find(|&n| key[..n].iter().any(|before| before[1] == key[n][1]))
        .unwrap();
    // The published example: 1, 1.5, 1.5 and 2 have mean 1.5 and std 0.35355; repeats are not counted.
    for (reader, grade_given) in [("a", 1.0), ("b", 1.5), ("c, d", 1.5), ("e", 2.0)] {
        let mut grades = [grade_given; 6];
        grades[again] = 3.0;
        grade(here, reader, &grades);
    }
    fs::rename(here.join("c, d.csv"), here.join("c.csv")).unwrap();
    let surrogate = r#"{"xray_image_5.png": {"label": 3.0, "std": 0.5, "step": 5, "label_source": "surrogate-jso/1"}}"#;
    fs::write(here.join("data/patient_3/labels/r/labels.json"), surrogate).unwrap();

    let said = succeed(
        here,
        "label import data --key out.key.csv e.csv b.csv c.csv a.csv --json",
    );
    let said: Value = serde_json::from_str(&said).unwrap();
    let expected = serde_json::json!({
        "readers": 4, "labelled": 5, "repeats": 4, "replaced_computed": 1, "kept_computed": 0, "without_label": 0
    });
    assert_eq!(said, expected);
    let found = labels(here);
    assert_eq!(found.as_object().unwrap().len(), 5);
    let label = &found["xray_image_10.png"];
    assert_eq!((&label["label"], &label["step"]), (&1.5.into(), &10.into()));
    assert_eq!(label["label_source"], "readers");
    assert!((label["std"].as_f64().unwrap() - 0.353_55).abs() < 5e-6);

    let agreed = succeed(here, "label agree data/grades.csv --json");
    let agreed: Value = serde_json::from_str(&agreed).unwrap();
    assert_eq!(agreed["images"], 5);
    assert_eq!(agreed["readers"][0]["against_self"]["mae"], 2.0);

    // Another reader adds to the existing grades; a file without these would lose them.
    grade(here, "f", &[3.0; 4]);
    let lost = fail(here, "label import data --key out.key.csv f.csv");
    assert!(lost.contains("none of the given files does"), "{lost}");
    assert_eq!(labels(here), found);
    succeed(
        here,
        "label import data --key out.key.csv data/grades.csv f.csv",
    );
    let [_, image, _] = &key[0];
    let label = &labels(here)[file_name(image)]["label"];
    assert_eq!(label.as_f64(), Some((1.0 + 1.5 + 1.5 + 2.0 + 3.0) / 5.0));
}

#[test]
fn a_flipped_bit_in_labels_grades_or_a_split_is_found() {
    let folder = exported();
    let here = folder.path();
    grade(here, "a", &[1.0; 6]);
    succeed(here, "label import data --key out.key.csv a.csv");
    succeed(here, "dataset split data --name mine --part train=1");
    succeed(here, "dataset check data");
    let root = here.join("data");
    for file in [
        "patient_3/labels/r/labels.json",
        "grades.csv",
        "splits/mine.json",
        "labels.sha256",
    ] {
        let bytes = fs::read(root.join(file)).unwrap();
        for bit in [8, 3999, 4 * bytes.len() + 1].map(|bit| bit % (8 * bytes.len())) {
            let mut flipped = bytes.clone();
            flipped[bit / 8] ^= 1 << (bit % 8);
            fs::write(root.join(file), flipped).unwrap();
            let said = fail(here, "dataset check data");
            assert!(said.contains(file), "bit {bit} of {file}: {said}");
        }
        fs::write(root.join(file), bytes).unwrap();
    }
    // Recorded labels stay recorded when others are added.
    succeed(here, "dataset split data --name other --part train=1");
    fs::remove_file(root.join("grades.csv")).unwrap();
    let said = fail(here, "dataset check data");
    assert!(said.contains("grades.csv is missing or altered"), "{said}");
    fs::remove_file(root.join("labels.sha256")).unwrap();
    succeed(here, "dataset check data");
}

#[test]
fn grades_that_cannot_be_are_named_and_nothing_is_written() {
    let folder = exported();
    let here = folder.path();
    let key = key(here);
    let refused = |csv: &str, expected: &str| {
        fs::write(here.join("x.csv"), format!("image,reader,grade\n{csv}\n")).unwrap();
        let said = fail(here, "label import data --key out.key.csv x.csv");
        assert!(said.contains(expected), "{said}");
        assert!(!here.join("data/grades.csv").exists());
    };
    let [name, image, _] = &key[0];
    refused(
        &format!("{name},a,0.5"),
        "as 0.5, expected 1, 1.5, 2, 2.5 or 3",
    );
    refused(&format!("{name},a,1.2"), "as 1.2, expected");
    refused(&format!("{name},a,good"), "x.csv is not the expected table");
    refused(
        "0123456789,a,1",
        "0123456789 is neither a picture in the key",
    );
    refused(&format!("{name},a,1\n{name},a,2"), "a grades");
    refused(
        &format!("{image},a,1\n{image},a,2\n{image},a,2"),
        "in x.csv and again in x.csv",
    );
    grade(here, "a", &[1.0; 6]);
    fs::copy(here.join("a.csv"), here.join("b.csv")).unwrap();
    let twice = fail(here, "label import data --key out.key.csv a.csv b.csv");
    assert!(twice.contains("in a.csv and again in b.csv"), "{twice}");

    // The dataset was replaced in the meantime, with another seed.
    let plan = fs::read_to_string(here.join("plan.toml")).unwrap();
    fs::write(here.join("plan.toml"), format!("seed = 9\n{plan}")).unwrap();
    succeed(here, "generate plan.toml --out data --replace");
    let changed = fail(here, "label import data --key out.key.csv a.csv");
    assert!(
        changed.contains("is not the radiograph that the readers saw"),
        "{changed}"
    );
}

#[test]
fn no_grade_and_no_label_of_readers_is_lost() {
    let folder = exported();
    let here = folder.path();
    let key = key(here);
    grade(here, "a", &[1.0, 1.5, 2.0, 2.5, 3.0, 3.0]);
    succeed(here, "label import data --key out.key.csv a.csv");
    let kept = fs::read_to_string(here.join("data/grades.csv")).unwrap();
    let before = labels(here);
    for [_, image, sha256] in &key {
        assert!(kept.contains(sha256), "grades.csv names what was graded");
        assert_eq!(before[file_name(image)]["radiograph_sha256"], **sha256);
    }

    // Imports that would drop second grades or change existing grades are refused.
    grade(here, "a", &[1.0, 1.5, 2.0, 2.5, 3.0]);
    let lost = fail(here, "label import data --key out.key.csv a.csv");
    assert!(lost.contains("holds a's grade"), "{lost}");
    grade(here, "a", &[3.0, 1.5, 2.0, 2.5, 3.0, 3.0]);
    let lost = fail(here, "label import data --key out.key.csv a.csv");
    assert!(lost.contains("holds a's grade 1 of"), "{lost}");
    // Any number of files that together contain all grades: a page may have been saved in parts.
    let whole = "image,reader,grade\n".to_owned();
    let row = |n: usize, grade: f64| format!("{},a,{grade}\n", key[n][0]);
    let grades = [1.0, 1.5, 2.0, 2.5, 3.0, 3.0];
    for (name, part) in [("p.csv", 0..3), ("q.csv", 3..6)] {
        let rows: String = part.map(|n| row(n, grades[n])).collect();
        fs::write(here.join(name), whole.clone() + &rows).unwrap();
    }
    succeed(here, "label import data --key out.key.csv p.csv q.csv");
    assert_eq!(
        fs::read_to_string(here.join("data/grades.csv")).unwrap(),
        kept
    );
    assert_eq!(labels(here), before);
    let twice = fail(
        here,
        "label import data --key out.key.csv data/grades.csv p.csv q.csv",
    );
    assert!(twice.contains("a grades"), "{twice}");

    // Labels of readers whose grades are not in the dataset.
    fs::rename(here.join("data/grades.csv"), here.join("grades.csv")).unwrap();
    let refused = fail(here, "label import data --key out.key.csv p.csv");
    assert!(
        refused.contains("do not follow from grades.csv"),
        "{refused}"
    );
    assert_eq!(labels(here), before);
    // Grades that give these labels are accepted, as after an import that was stopped before it wrote grades.csv.
    succeed(here, "label import data --key out.key.csv p.csv q.csv");
    assert_eq!(
        fs::read_to_string(here.join("data/grades.csv")).unwrap(),
        kept
    );
    assert_eq!(labels(here), before);

    // The radiographs are replaced, but labels and grades belong to the old ones.
    let plan = fs::read_to_string(here.join("plan.toml")).unwrap();
    fs::write(here.join("plan.toml"), format!("seed = 9\n{plan}")).unwrap();
    let done = ppa(here, "generate plan.toml --out data --replace")
        .output()
        .unwrap();
    let report = String::from_utf8(done.stderr).unwrap();
    assert!(
        done.status.success()
            && report.contains(
                "5 labels of radiographs that have since been replaced, the first at step 0"
            ),
        "{report}"
    );
    for command in ["dataset check data", "export table data --out t.csv"] {
        let refused = fail(here, command);
        assert!(refused.contains("step 0"), "{refused}");
    }
    let refused = fail(here, "label import data data/grades.csv");
    assert!(
        refused.contains("a graded a different version"),
        "{refused}"
    );
    assert_eq!(labels(here), before);
}
