//! Predictions that are all equal.

use std::fs;

use serde_json::Value;

use crate::succeed;

#[test]
fn metrics_of_a_constant_say_so_first() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let write = |name: &str, predictions: [f64; 4]| {
        let rows = ["a,1", "b,1.5", "c,2.5", "d,3"].iter().zip(predictions);
        let rows: String = rows
            .map(|(row, value)| format!("{row},{value}\n"))
            .collect();
        fs::write(folder.join(name), format!("id,label,prediction\n{rows}")).unwrap();
    };
    write("constant.csv", [2.0; 4]);
    let said = succeed(folder, "metrics constant.csv");
    let first = said.lines().next().unwrap();
    assert!(
        first.starts_with("The network predicts a constant: 2.000"),
        "{said}"
    );
    assert!(said.contains("Spearman             not defined"), "{said}");
    let said: Value =
        serde_json::from_str(&succeed(folder, "metrics constant.csv --json")).unwrap();
    assert_eq!(said["constant_prediction"]["mean"], 2.0);
    assert_eq!((&said["spearman"], &said["n"]), (&Value::Null, &4.into()));

    // Within 1 % of the labels' range, and beyond.
    write("nearly.csv", [2.0, 2.001, 2.002, 2.003]);
    let said = succeed(folder, "metrics nearly.csv");
    assert!(
        said.starts_with("The network predicts a constant"),
        "{said}"
    );
    assert!(said.contains("Spearman             1.0000"), "{said}");
    write("varied.csv", [1.9, 2.0, 2.1, 2.2]);
    let said: Value = serde_json::from_str(&succeed(folder, "metrics varied.csv --json")).unwrap();
    assert_eq!(said["constant_prediction"], Value::Null);
}
