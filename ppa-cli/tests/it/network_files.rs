//! Networks exported for other programs, from folders of training runs and from weight files.

use std::fs;

use crate::prediction::trained;
use crate::{fail, succeed};

#[test]
fn pairs_are_exported_from_trainings_and_weight_files() {
    let folder = trained();
    let export = |what: &str, to: &str| -> Vec<u8> {
        let said = succeed(
            folder,
            &format!("learn export {what} --replace --out {to} --json"),
        );
        let said: serde_json::Value = serde_json::from_str(&said).unwrap();
        assert_eq!(said["unused"], serde_json::json!([]));
        fs::read(folder.join(to)).unwrap()
    };
    for (what, name) in [("pairs", "pairs"), ("left right", "both")] {
        let model = export(what, &format!("{name}.onnx"));
        for name in ["left", "right", "quality"] {
            let name = name.as_bytes();
            assert!(model.windows(name.len()).any(|bytes| bytes == name));
        }
        let weights = format!("{name}.safetensors");
        export(what, &weights);
        // The names in the file show that it contains two networks.
        assert!(export(&weights, "again.onnx") == model, "{what}");
        assert!(export(&weights, "again.safetensors") == fs::read(folder.join(&weights)).unwrap());
    }
    let same = fs::read(folder.join("pairs/weights.safetensors")).unwrap();
    assert!(fs::read(folder.join("pairs.safetensors")).unwrap() == same);

    let refused = fail(folder, "learn export right left --out no.onnx");
    let expected = "right was trained with views = \"right\", expected \"left\" or \"unified\"";
    assert!(refused.contains(expected), "{refused}");
    let refused = fail(folder, "learn export pairs.safetensors right --out no.onnx");
    assert!(
        refused.contains("expects images of 2 cameras, found images of 1"),
        "{refused}"
    );
    assert!(!folder.join("no.onnx").exists());
}

#[test]
fn surplus_of_a_start_file_is_reported_by_name() {
    let folder = trained();
    let config = fs::read_to_string(folder.join("left.toml")).unwrap();
    let config = format!("start = \"right/checkpoint.safetensors\"\n{config}");
    fs::write(folder.join("begun.toml"), config).unwrap();
    let said = succeed(folder, "train begun.toml --out begun --json");
    let said: serde_json::Value = serde_json::from_str(&said).unwrap();
    assert_eq!(said["start"]["kept"], serde_json::json!([]));
    let unused = &said["start"]["unused"];
    assert_eq!(unused.as_array().unwrap().len(), 4, "{unused}");
    assert_eq!(unused[0], "adam.first.0");
}
