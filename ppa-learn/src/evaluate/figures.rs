//! The figures of a training and its evaluation.

use crate::train::LogRow;

use super::figure::{Figure, Mark, Series, Tile};
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
        tiles: Vec::new(),
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

/// How many images of each class of the label were put into which class, of N classes from 1 to 3; tinted by their share of the class.
pub fn confusion_figure<const N: usize>(table: &[[usize; N]; N]) -> Figure {
    let half = 1.0 / (N - 1) as f64;
    let ends = |class: usize| {
        let middle = 1.0 + 2.0 * half * class as f64;
        [middle - half, middle + half]
    };
    let tile = |label: usize, prediction: usize| {
        let (count, all) = (table[label][prediction], table[label].iter().sum::<usize>());
        let share = count as f64 / all.max(1) as f64;
        Tile {
            ranges: [ends(label), ends(prediction)],
            share: 0.6 * share, // text stays legible on it
            text: match count {
                0 => String::new(),
                _ => format!("{count} ({:.0} %)", 100.0 * share),
            },
        }
    };
    let tiles = (0..N).flat_map(|label| (0..N).map(move |prediction| tile(label, prediction)));
    let labels = ["class of the label", "class of the prediction"];
    let title = "Images by class (share of the label's class)";
    Figure {
        tiles: tiles.collect(),
        ..figure(title, labels, [[1.0 - half, 3.0 + half]; 2], Vec::new())
    }
}

/// Mean prediction of the images of each label, and mean label and prediction of images that are predicted alike.
pub fn calibration_figure(evaluation: &Evaluation) -> Figure {
    let points = |means: &[(f64, f64, usize)]| {
        let points = means.iter().map(|&(label, mean, _)| [label, mean]);
        points.collect::<Vec<_>>()
    };
    let by_label = points(&evaluation.calibration);
    let by_prediction = points(&evaluation.calibration_by_prediction);
    let series = vec![
        series("by label", Mark::DotsAndLine, by_label),
        series("by prediction", Mark::DotsAndLine, by_prediction),
        ideal(),
    ];
    let labels = ["mean label", "mean prediction"];
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
    let series = vec![series("images", Mark::DotsAndLine, errors)];
    figure("Errors by angle", labels, ranges, series)
}

/// Loss of training and errors of evaluation against steps.
pub fn learning_curve(log: &[LogRow]) -> Figure {
    let of_tag = |tag: &str, name: &str, mark| {
        let rows = log.iter();
        let points = rows.filter_map(|row| Some([row.step as f64, *row.scalars.get(tag)?]));
        series(name, mark, points.collect())
    };
    let curves = vec![
        of_tag("training/loss", "training MSE", Mark::Line),
        of_tag("evaluation/mse", "evaluation MSE", Mark::DotsAndLine),
        of_tag("evaluation/mae", "evaluation MAE", Mark::DotsAndLine),
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
