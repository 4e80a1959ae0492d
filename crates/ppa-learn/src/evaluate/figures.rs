//! The figures of a training and its evaluation.

use crate::train::LogRow;

use super::figure::{Figure, Mark, Series};
use super::report::Evaluation;
use super::row::Row;

/// Ends of an axis of qualities: half a class beyond the scale.
const QUALITY: [f64; 2] = [0.5, 3.5];

fn series(name: &str, mark: Mark, points: Vec<[f64; 2]>) -> Series {
    Series {
        name: name.to_owned(),
        mark,
        points,
    }
}

fn figure(title: &str, labels: [&str; 2], ranges: [[f64; 2]; 2], series: Vec<Series>) -> Figure {
    Figure {
        title: title.to_owned(),
        labels: labels.map(str::to_owned),
        ranges,
        series,
    }
}

/// From 0 to a tenth above the greatest value; to 1 where there is none.
fn from_zero(values: impl Iterator<Item = f64>) -> [f64; 2] {
    let greatest = values.fold(0.0, f64::max);
    [0.0, if greatest > 0.0 { 1.1 * greatest } else { 1.0 }]
}

fn ideal() -> Series {
    series("ideal", Mark::Line, vec![[1.0, 1.0], [3.0, 3.0]])
}

/// Predictions against labels, by image.
pub fn scatter(rows: &[Row]) -> Figure {
    let points = rows.iter().map(|row| [row.label, row.prediction]).collect();
    let series = vec![series("images", Mark::Dots, points), ideal()];
    let labels = ["label", "prediction"];
    figure("Predictions against labels", labels, [QUALITY; 2], series)
}

/// Mean prediction against label.
pub fn calibration_figure(evaluation: &Evaluation) -> Figure {
    let means = evaluation.calibration.iter();
    let means: Vec<[f64; 2]> = means.map(|&(label, mean, _)| [label, mean]).collect();
    let series = vec![series("means", Mark::Line, means), ideal()];
    let labels = ["label", "mean prediction"];
    figure("Calibration", labels, [QUALITY; 2], series)
}

/// Mean absolute error against medial rotation.
pub fn error_figure(evaluation: &Evaluation) -> Figure {
    let errors = evaluation.error_by_angle.iter();
    let errors: Vec<[f64; 2]> = errors.map(|&(angle, error, _)| [angle, error]).collect();
    let ranges = [
        from_zero(errors.iter().map(|point| point[0])),
        from_zero(errors.iter().map(|point| point[1])),
    ];
    let labels = ["medial rotation in degrees", "mean absolute error"];
    let series = vec![series("images", Mark::Line, errors)];
    figure("Errors by angle", labels, ranges, series)
}

/// Loss of training and errors of evaluation against steps.
pub fn learning_curve(log: &[LogRow]) -> Figure {
    let of_tag = |tag: &str, name: &str| {
        let rows = log.iter();
        let points = rows.filter_map(|row| Some([row.step as f64, *row.scalars.get(tag)?]));
        series(name, Mark::Line, points.collect())
    };
    let curves = vec![
        of_tag("training/loss", "training MSE"),
        of_tag("evaluation/mse", "evaluation MSE"),
        of_tag("evaluation/mae", "evaluation MAE"),
    ];
    // The first losses would squeeze all others: the axis ends at five times the median.
    let mut values: Vec<f64> = curves
        .iter()
        .flat_map(|c| &c.points)
        .map(|p| p[1])
        .collect();
    values.sort_by(f64::total_cmp);
    let median = values.get(values.len() / 2).copied();
    let bound = 5.0 * median.unwrap_or(1.0);
    let ranges = [
        from_zero(log.iter().map(|row| row.step as f64)),
        from_zero(values.into_iter().filter(|&value| value <= bound)),
    ];
    figure("Learning curve", ["step", "error"], ranges, curves)
}
