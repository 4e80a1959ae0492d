//! Labels: agreement of readers.

use std::fs;

use crate::{fail, succeed};

/// Grades of four readers for eight images; reader `d` saw two of them twice. Expected: `pingouin` 0.7.0 (intraclass
/// correlation), `krippendorff` 0.8 (alpha), scikit-learn 1.9.1 (kappa).
#[test]
fn agreement_of_readers_from_their_files() {
    let folder = tempfile::tempdir().unwrap();
    let grades = [
        [1.0, 1.0, 1.5, 1.0],
        [1.5, 2.0, 1.5, 1.5],
        [3.0, 2.5, 3.0, 3.0],
        [2.0, 2.0, 2.5, 1.5],
        [2.5, 3.0, 2.5, 2.5],
        [1.0, 1.5, 1.0, 1.0],
        [2.0, 1.5, 2.0, 2.5],
        [3.0, 3.0, 3.0, 2.5],
    ];
    for (reader, name) in ["a", "b", "c", "d"].iter().enumerate() {
        let mut csv = "image,reader,grade\n".to_owned();
        for (image, grades) in grades.iter().enumerate() {
            csv += &format!("x{image}.png,{name},{}\n", grades[reader]);
        }
        if *name == "d" {
            csv += "x0.png,d,1.5\nx7.png,d,2.5\n";
        }
        fs::write(folder.path().join(format!("{name}.csv")), csv).unwrap();
    }
    let arguments = "label agree a.csv b.csv c.csv d.csv";
    let json = succeed(folder.path(), &format!("{arguments} --json"));
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    let close = |value: &serde_json::Value, expected: f64| {
        let value = value.as_f64().unwrap();
        assert!((value - expected).abs() < 1e-7, "{value}, {expected}");
    };
    close(&json["icc"]["agreement_single"]["value"], 0.846_649_484_5);
    close(&json["icc"]["agreement_single"]["low"], 0.634_504_34);
    close(&json["icc"]["agreement_mean"]["high"], 0.990_223_17);
    close(&json["alpha_ordinal"], 0.829_871_727_498_566_7);
    close(
        &json["pairs"][0]["kappa_quadratic"],
        0.848_484_848_484_848_5,
    );
    close(&json["pairs"][2]["kappa_linear"], 0.777_777_777_777_777_8);
    let own = &json["readers"][3]["against_self"];
    assert_eq!(
        (own["images"].as_u64(), own["equal"].as_f64()),
        (Some(2), Some(0.5))
    );
    assert_eq!(json["readers"][0]["against_self"], serde_json::Value::Null);
    assert_eq!(json["largest_disagreements"][0]["image"], "x3.png");
    assert!(succeed(folder.path(), arguments).contains("ICC(A,1)  0.8466"));

    fs::write(
        folder.path().join("e.csv"),
        "image,reader,grade\nx0.png,e,4\n",
    )
    .unwrap();
    let refused = fail(folder.path(), "label agree a.csv e.csv");
    assert!(
        refused.contains("e grades x0.png as 4, expected 1, 1.5, 2, 2.5 or 3"),
        "{refused}"
    );
    fs::write(
        folder.path().join("f.csv"),
        "image,reader,grade\nx0.png,d,1\n",
    )
    .unwrap();
    let thrice = fail(folder.path(), "label agree d.csv f.csv");
    assert!(thrice.contains("d grades x0.png a third time"), "{thrice}");
    let folder_given = fail(folder.path(), "label agree .");
    assert!(folder_given.contains("cannot read ."), "{folder_given}");
    let alone = fail(folder.path(), "label agree a.csv");
    assert!(
        alone.contains("the number of readers is 1, expected at least 2"),
        "{alone}"
    );
}
