//! Evaluations as tables in a folder.

use std::path::Path;

use ppa_dataset::write_whole;
use serde::Serialize;

use super::error::EvaluateError;
use super::poses::poses;
use super::report::Evaluation;
use super::row::Row;

/// Names of the files that [`write_evaluation`] writes.
pub const EVALUATION_TABLES: [&str; 3] = ["predictions.csv", "poses.csv", "evaluation.json"];

/// Writes `predictions.csv` (one row per image), `poses.csv` and `evaluation.json`.
///
/// # Errors
/// [`EvaluateError`] naming the file that cannot be written.
pub fn write_evaluation(
    folder: &Path,
    rows: &[Row],
    evaluation: &Evaluation,
) -> Result<(), EvaluateError> {
    let [by_image, by_pose, all] = EVALUATION_TABLES.map(|name| folder.join(name));
    write_predictions(&by_image, rows)?;
    write_csv(&by_pose, &poses(rows))?;
    let json = serde_json::to_string_pretty(evaluation).expect("names and numbers are JSON");
    Ok(write_whole(&all, json.as_bytes())?)
}

/// Writes rows as CSV with a header.
///
/// # Errors
/// [`EvaluateError`] naming the file that cannot be written.
pub fn write_predictions(path: &Path, rows: &[Row]) -> Result<(), EvaluateError> {
    write_csv(path, rows)
}

fn write_csv<T: Serialize>(path: &Path, rows: &[T]) -> Result<(), EvaluateError> {
    let mut table = csv::Writer::from_writer(Vec::new());
    for row in rows {
        table.serialize(row)?;
    }
    let table = table.into_inner().map_err(|error| error.into_error());
    let table = table.map_err(csv::Error::from)?;
    Ok(write_whole(path, &table)?)
}
