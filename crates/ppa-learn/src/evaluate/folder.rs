//! An evaluation as files.

use std::path::Path;

use ppa_dataset::write_whole;
use serde::Serialize;

use super::error::EvaluateError;
use super::figure::Figure;
use super::figures::{calibration_figure, confusion_figure, error_figure, scatter};
use super::poses::poses;
use super::report::Evaluation;
use super::row::Row;

/// Writes `predictions.csv` (a row per image), `poses.csv`, `evaluation.json`, and the figures `scatter`, `confusion`,
/// `confusion_half_steps`, `calibration`, `errors_by_angle` (where angles are known) and those given, by name, each as SVG and PNG.
///
/// # Errors
/// [`EvaluateError`] naming the file that cannot be written.
pub fn write_evaluation(
    folder: &Path,
    rows: &[Row],
    evaluation: &Evaluation,
    more: Vec<(&str, Figure)>,
) -> Result<(), EvaluateError> {
    write_predictions(&folder.join("predictions.csv"), rows)?;
    write_csv(&folder.join("poses.csv"), &poses(rows))?;
    let json = serde_json::to_string_pretty(evaluation).expect("names and numbers are JSON");
    write_whole(&folder.join("evaluation.json"), json.as_bytes())?;
    let mut figures = vec![
        ("scatter", scatter(rows)),
        ("confusion", confusion_figure(&evaluation.confusion)),
        (
            "confusion_half_steps",
            confusion_figure(&evaluation.confusion_half_steps),
        ),
        ("calibration", calibration_figure(evaluation)),
    ];
    if !evaluation.error_by_angle.is_empty() {
        figures.push(("errors_by_angle", error_figure(evaluation)));
    }
    for (name, figure) in figures.into_iter().chain(more) {
        write_whole(
            &folder.join(format!("{name}.svg")),
            figure.to_svg().as_bytes(),
        )?;
        write_whole(&folder.join(format!("{name}.png")), &figure.to_png())?;
    }
    Ok(())
}

/// Writes rows as CSV, with a heading.
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
