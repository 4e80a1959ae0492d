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

const TABLES: [&str; 3] = ["predictions.csv", "poses.csv", "evaluation.json"];
const FIGURES: [&str; 5] = [
    "scatter",
    "confusion",
    "confusion_half_steps",
    "calibration",
    "errors_by_angle",
];

/// Names of the files that [`write_evaluation`] may write, with further figures.
pub fn evaluation_files(more: &[&str]) -> Vec<String> {
    let figures = FIGURES.iter().chain(more);
    let figures = figures.flat_map(|name| [format!("{name}.svg"), format!("{name}.png")]);
    TABLES
        .map(str::to_owned)
        .into_iter()
        .chain(figures)
        .collect()
}

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
    let [by_image, by_pose, all] = TABLES.map(|name| folder.join(name));
    write_predictions(&by_image, rows)?;
    write_csv(&by_pose, &poses(rows))?;
    let json = serde_json::to_string_pretty(evaluation).expect("names and numbers are JSON");
    write_whole(&all, json.as_bytes())?;
    let mut figures = vec![
        scatter(rows),
        confusion_figure(&evaluation.confusion),
        confusion_figure(&evaluation.confusion_half_steps),
        calibration_figure(evaluation),
    ];
    if !evaluation.error_by_angle.is_empty() {
        figures.push(error_figure(evaluation));
    }
    for (name, figure) in FIGURES.into_iter().zip(figures).chain(more) {
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
