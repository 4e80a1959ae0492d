//! Results stated in the paper, to be shown next to ours.

use super::configuration::Configuration;
use super::metric::Metric;

/// Tables 1 to 4 of Laufer et al., MELBA 2026:027: experiment, column, metric, mean and standard deviation over ten seeds, as printed.
const TABLES: &str = include_str!("published.csv");

/// Returns the mean and standard deviation that the paper states for a cell, as printed: shares in percent.
pub fn published(column: Configuration, metric: Metric) -> Option<[&'static str; 2]> {
    let name = column.name();
    let metric = metric.name().trim_end_matches(" [%]");
    TABLES.lines().find_map(|line| {
        let mut fields = line.split(',');
        let key = [fields.next()?, fields.next()?, fields.next()?];
        let found = key == [column.experiment.name(), &name, metric];
        found.then_some([fields.next()?, fields.next()?])
    })
}

#[cfg(test)]
mod tests {
    use super::super::configuration::Experiment;
    use super::*;

    #[test]
    fn every_cell_of_the_papers_tables_is_there() {
        let cells = Experiment::OF_PAPER.into_iter().flat_map(|experiment| {
            let metrics = Metric::of(experiment);
            let columns = experiment.configurations().into_iter();
            columns.flat_map(move |column| metrics.clone().into_iter().map(move |m| (column, m)))
        });
        let cells: Vec<_> = cells.collect();
        assert_eq!(cells.len(), TABLES.lines().count() - 1);
        for (column, metric) in cells {
            let [mean, std] = published(column, metric).unwrap();
            let [mean, std] = [mean, std].map(|text| text.parse::<f64>().unwrap());
            // A correlation of predictions that are all equal is printed as 0 +- 0.
            assert!(
                std >= 0.0 && mean.abs() <= metric.scale() * 2.0,
                "{column:?} {metric:?}"
            );
        }
        let one = Experiment::One.configurations()[1];
        assert_eq!(published(one, Metric::Accuracy), Some(["87.6", "2.6"]));
    }
}
