//! Charts of a training run and of an evaluation of its network.

use crate::chart::{Chart, Mark, Series, Tile};

/// Ends of an axis of qualities: half a class beyond the scale.
const QUALITY: [f64; 2] = [0.5, 3.5];

fn chart(title: &str, labels: [&str; 2], ranges: [[f64; 2]; 2], series: Vec<Series>) -> Chart {
    Chart {
        size: [640, 480],
        title: title.to_owned(),
        labels: labels.map(str::to_owned),
        ranges,
        tiles: Vec::new(),
        series,
    }
}

/// Range from 0 to a tenth above the largest value; to 1 if no value is positive.
fn from_zero(values: impl Iterator<Item = f64>) -> [f64; 2] {
    let greatest = values.fold(0.0, f64::max);
    [0.0, if greatest > 0.0 { 1.1 * greatest } else { 1.0 }]
}

fn ideal() -> Series {
    Series::new("ideal", Mark::Line, vec![[1.0, 1.0], [3.0, 3.0]])
}

/// Predictions against labels, a point for each image.
pub fn predictions_by_label(points: Vec<[f64; 2]>) -> Chart {
    let series = vec![Series::new("images", Mark::Dots, points), ideal()];
    let labels = ["label", "prediction"];
    chart("Predictions against labels", labels, [QUALITY; 2], series)
}

/// Number of images of each class of the label (row) that were assigned to each class (column), of N classes from 1 to 3; tinted by
/// their share of the label's class.
pub fn confusion<const N: usize>(table: &[[usize; N]; N]) -> Chart {
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
    Chart {
        tiles: tiles.collect(),
        ..chart(title, labels, [[1.0 - half, 3.0 + half]; 2], Vec::new())
    }
}

/// Mean predictions against mean labels: for the images of each label, and for images with similar predictions.
pub fn calibration(by_label: Vec<[f64; 2]>, by_prediction: Vec<[f64; 2]>) -> Chart {
    let series = vec![
        Series::new("by label", Mark::DotsAndLine, by_label),
        Series::new("by prediction", Mark::DotsAndLine, by_prediction),
        ideal(),
    ];
    let labels = ["mean label", "mean prediction"];
    chart("Calibration", labels, [QUALITY; 2], series)
}

/// Mean absolute errors against medial rotation in degrees, of named series.
pub fn errors_by_angle(series: Vec<(String, Vec<[f64; 2]>)>) -> Chart {
    errors_along("Errors by angle", "medial rotation in degrees", series)
}

/// Mean absolute error against the amount of training data, such as "persons", of a network and of baselines.
pub fn errors_by_amount(amount: &str, series: Vec<(String, Vec<[f64; 2]>)>) -> Chart {
    errors_along("Errors by training data", amount, series)
}

fn errors_along(title: &str, along: &str, series: Vec<(String, Vec<[f64; 2]>)>) -> Chart {
    let of = |axis: usize| {
        series
            .iter()
            .flat_map(|s| &s.1)
            .map(move |point| point[axis])
    };
    let ranges = [0, 1].map(|axis| from_zero(of(axis)));
    let labels = [along, "mean absolute error"];
    let series = series.into_iter();
    let series = series.map(|(name, points)| Series::new(&name, Mark::DotsAndLine, points));
    let series = series.collect();
    chart(title, labels, ranges, series)
}

/// Loss in training and errors in evaluation against steps.
pub fn learning_curve(
    training_mse: Vec<[f64; 2]>,
    evaluation_mse: Vec<[f64; 2]>,
    evaluation_mae: Vec<[f64; 2]>,
) -> Chart {
    let curves = vec![
        Series::new("training MSE", Mark::Line, training_mse),
        Series::new("evaluation MSE", Mark::DotsAndLine, evaluation_mse),
        Series::new("evaluation MAE", Mark::DotsAndLine, evaluation_mae),
    ];
    let of = |axis: usize| curves.iter().flat_map(|c| &c.points).map(move |p| p[axis]);
    // Large first losses would compress all others: the axis ends at five times the median.
    let mut errors: Vec<f64> = of(1).collect();
    errors.sort_by(f64::total_cmp);
    let bound = 5.0 * errors.get(errors.len() / 2).copied().unwrap_or(1.0);
    let ranges = [
        from_zero(of(0)),
        from_zero(errors.into_iter().filter(|&error| error <= bound)),
    ];
    chart("Learning curve", ["step", "error"], ranges, curves)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One loss of 100 among hundreds of 1 does not determine the axis.
    #[test]
    fn the_first_losses_do_not_squeeze_the_curve() {
        let losses = (0..9).map(|step| [f64::from(step), if step == 0 { 100.0 } else { 1.0 }]);
        let chart = learning_curve(losses.collect(), vec![[8.0, 2.0]], Vec::new());
        let [steps, errors] = chart.ranges;
        assert_eq!(steps, [0.0, 1.1 * 8.0]);
        assert_eq!(errors, [0.0, 2.2]);
    }

    #[test]
    fn errors_along_an_axis_begin_at_zero_and_fit() {
        let network = ("network".to_owned(), vec![[5.0, 0.5], [40.0, 0.25]]);
        let baseline = ("constant".to_owned(), vec![[5.0, 1.0], [40.0, 1.0]]);
        let chart = errors_by_amount("persons", vec![network, baseline]);
        assert_eq!(chart.labels, ["persons", "mean absolute error"]);
        assert_eq!(chart.ranges, [[0.0, 1.1 * 40.0], [0.0, 1.1]]);
        assert_eq!(chart.series.len(), 2);
    }

    /// Rows are labels, which are along the first axis.
    #[test]
    fn shares_are_of_the_labels_class() {
        let chart = confusion(&[[1, 3], [0, 0]]);
        let texts: Vec<&str> = chart.tiles.iter().map(|tile| tile.text.as_str()).collect();
        assert_eq!(texts, ["1 (25 %)", "3 (75 %)", "", ""]);
        assert_eq!(chart.tiles[1].ranges, [[0.0, 2.0], [2.0, 4.0]]);
    }
}
