//! Tests of label files: what is read, written and refused.

use super::*;
use crate::layout::Side;

const LIMB: LimbId = LimbId {
    patient: 0,
    side: Side::Right,
};

fn read(text: &str) -> Result<LabelFile, String> {
    serde_json::from_str(text).map_err(|error| error.to_string())
}

/// The example of the published dataset's README.
#[test]
fn published_labels_are_read() {
    let text = r#"{"xray_image_180.png": {"label": 3.0, "std": 0.0, "step": 180}}"#;
    let found = read(text).unwrap();
    assert_eq!(found.source_of_step(180), None);
    let expected = LabelRow {
        label: 3.0,
        std: 0.0,
        step: 180,
    };
    assert_eq!(found.labels(), [expected]);
    assert_eq!(found.of_step(180), Some(&expected));
    let written: serde_json::Value = serde_json::to_value(&found).unwrap();
    assert_eq!(
        written,
        serde_json::from_str::<serde_json::Value>(text).unwrap()
    );
}

#[test]
fn labels_come_back_as_they_were_written() {
    let root = tempfile::tempdir().unwrap();
    assert_eq!(LabelFile::read(root.path(), LIMB).unwrap(), None);
    let rows = [(100, 1.25), (9, 3.0), (36, 1.0)].map(|(step, label)| LabelRow {
        label,
        std: 0.1 + 0.2,
        step,
    });
    let labels = LabelFile::new(LabelSource::Strict, rows).unwrap();
    labels.write(root.path(), LIMB).unwrap();
    let path = root.path().join("patient_0/labels/r/labels.json");
    assert!(
        std::fs::read_to_string(path)
            .unwrap()
            .contains("surrogate-jso/1")
    );
    let found = LabelFile::read(root.path(), LIMB).unwrap().unwrap();
    assert_eq!(found, labels);
    let steps: Vec<u32> = found.labels().iter().map(|row| row.step).collect();
    assert_eq!(steps, [9, 36, 100]);
}

#[test]
fn what_is_no_label_is_named() {
    let one = |name: &str, row: &str| read(&format!(r#"{{"{name}": {{{row}}}}}"#)).unwrap_err();
    let refused = [
        (
            "xray_image_36.png",
            r#""label": 3.5, "std": 0.0, "step": 36"#,
            "label 3.5, expected 1 to 3",
        ),
        (
            "xray_image_36.png",
            r#""label": 0.0, "std": 0.0, "step": 36"#,
            "label 0, expected 1 to 3",
        ),
        (
            "xray_image_36.png",
            r#""label": 1.0, "std": 1.5, "step": 36"#,
            "std 1.5, expected 0 to 1",
        ),
        (
            "xray_image_36.png",
            r#""label": 1.0, "std": 0.0, "step": 37"#,
            "step 37",
        ),
        (
            "xray_image_36.0.png",
            r#""label": 1.0, "std": 0.0, "step": 36"#,
            "xray_image_36.0.png has the step",
        ),
        (
            "xray_image_361.png",
            r#""label": 1.0, "std": 0.0, "step": 361"#,
            "180.5 degrees",
        ),
        (
            "xray_image_36.png",
            r#""label": 1.0, "step": 36"#,
            "missing field `std`",
        ),
        (
            "xray_image_36.png",
            r#""label": 1.0, "std": 0.0, "step": 36, "label_source": "me""#,
            "unknown variant `me`",
        ),
    ];
    for (name, row, expected) in refused {
        let said = one(name, row);
        assert!(said.contains(expected), "{said}");
    }
    let row = r#"{"label": 1.0, "std": 0.0, "step": 36}"#;
    let twice = format!(r#"{{"xray_image_36.png": {row}, "xray_image_36.png": {row}}}"#);
    assert!(
        read(&twice)
            .unwrap_err()
            .contains("xray_image_36.png is listed twice")
    );
    let beyond = LabelRow {
        label: 1.0,
        std: 0.0,
        step: 400,
    };
    let error = LabelFile::new(LabelSource::Readers, [beyond]).unwrap_err();
    assert_eq!(
        error,
        LabelError::Angle("xray_image_400.png".to_owned(), 200.0)
    );
}

#[test]
fn readers_stand_beside_one_kind_of_computed_labels() {
    let by = |source: &str, step: u32| {
        format!(r#""xray_image_{step}.png": {{"label": 1.0, "std": 0.0, "step": {step}{source}}}"#)
    };
    let readers = r#", "label_source": "readers""#;
    let surrogate = r#", "label_source": "surrogate-jso/1""#;
    let segmented = r#", "label_source": "surrogate-jso/1-segmented""#;
    let said = read(&format!("{{{}, {}}}", by(segmented, 1), by(surrogate, 2))).unwrap_err();
    assert!(
        said.contains(
            "xray_image_2.png is labelled by surrogate-jso/1, others by surrogate-jso/1-segmented"
        ),
        "{said}"
    );
    assert!(read(&format!("{{{}, {}}}", by(readers, 1), by("", 2))).is_err());
    assert!(read(&format!("{{{}, {}}}", by("", 1), by(surrogate, 2))).is_err());
    let three = [by(readers, 1), by(surrogate, 2), by(readers, 3)].join(", ");
    let found = read(&format!("{{{three}}}")).unwrap();
    assert_eq!(found.source_of_step(1), Some(LabelSource::Readers));
    assert_eq!(found.source_of_step(2), Some(LabelSource::Strict));
    assert_eq!(found.source_of_step(4), None);
}

#[test]
fn a_readers_label_wins_over_a_computed_one() {
    let row = |step, label| LabelRow {
        label,
        std: 0.0,
        step,
    };
    let computed =
        LabelFile::new(LabelSource::Strict, [row(1, 1.0), row(2, 1.5), row(3, 2.0)]).unwrap();
    let readers = LabelFile::new(LabelSource::Readers, [row(2, 3.0), row(5, 2.5)]).unwrap();
    let both = readers.clone().over(&computed);
    assert_eq!(
        both.labels(),
        [row(1, 1.0), row(2, 3.0), row(3, 2.0), row(5, 2.5)]
    );
    assert_eq!(both.not_computed(), readers);
    assert_eq!(both.computed().labels(), [row(1, 1.0), row(3, 2.0)]);
    assert_eq!(
        serde_json::from_str::<LabelFile>(&both.to_text()).unwrap(),
        both
    );
}
