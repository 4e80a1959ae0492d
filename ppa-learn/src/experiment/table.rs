//! Tables of results in the paper's form: mean ± standard deviation over the seeds, with the best value of each row in bold.

use ppa_core::text::count;
use ppa_metrics::LEAST_SPREAD;

use super::cell::{Cell, with_best};
use super::configuration::Configuration;
use super::metric::Metric;
use super::published::published;
use super::results::{Comparison, Difference, Missing, Results, Summary};
use crate::evaluate::BaselineKind;

/// A table with a row for each metric and a column for each configuration and each baseline.
#[derive(Debug, Clone)]
pub struct Table {
    columns: Vec<Column>,
    rows: Vec<(Metric, Vec<Cell>)>,
    /// Warning printed above the table if its numbers are misleading.
    warning: Option<String>,
    notes: Vec<String>,
}

/// A column of a table.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Column {
    Network(Configuration),
    Baseline(BaselineKind),
}

impl Column {
    fn headings(self) -> Vec<String> {
        match self {
            Self::Network(column) => column.headings(),
            Self::Baseline(kind) => vec![kind.to_string()],
        }
    }

    /// Returns the name for rows, unique within the experiment, of lower-case letters and `-`.
    fn name(self) -> String {
        match self {
            Self::Network(column) => column.name(),
            Self::Baseline(kind) => kind.to_string().replace(' ', "-"),
        }
    }

    /// Returns the column's cell for a metric.
    fn cell(self, metric: Metric, results: &Results) -> Cell {
        match self {
            Self::Network(column) => Cell::new(results.summary(column, metric), metric, results),
            Self::Baseline(kind) => Cell::without_seeds(results.of_baseline(kind, metric), metric),
        }
    }
}

/// A cell of a table as it is printed.
#[derive(Debug, Clone, PartialEq)]
pub struct TableCell {
    /// Mean, and standard deviation if there are several seeds.
    pub text: String,
    /// Whether it is the best value of its row.
    pub best: bool,
    /// Mean and standard deviation that the paper states.
    pub published: Option<[&'static str; 2]>,
}

/// Error for a table of incomplete results.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{} missing, the first is {first}{}", test_sets_are(*.count), diverged(*.not_finite))]
pub struct Incomplete {
    /// Number of missing test sets.
    pub count: usize,
    /// The first of them.
    pub first: Missing,
    /// A test set with predictions that are not finite.
    pub not_finite: Option<Missing>,
}

fn test_sets_are(n: usize) -> String {
    format!(
        "{} {}",
        count(n, "test set"),
        if n == 1 { "is" } else { "are" }
    )
}

fn diverged(place: Option<Missing>) -> String {
    place.map_or(String::new(), |place| {
        format!("; not all predictions of {place} are finite")
    })
}

impl Table {
    /// Makes the table of complete results.
    ///
    /// # Errors
    /// [`Incomplete`] if a test set is missing.
    pub fn complete(results: &Results) -> Result<Self, Incomplete> {
        let missing = results.missing();
        match missing.first() {
            Some(&first) => Err(Incomplete {
                count: missing.len(),
                first,
                not_finite: results.not_finite().first().copied(),
            }),
            None => Ok(Self::so_far(results)),
        }
    }

    /// Makes the table of the results so far; cells with fewer seeds than planned state their number.
    pub fn so_far(results: &Results) -> Self {
        let networks = results.columns().iter().copied().map(Column::Network);
        let baselines = results.baselines().into_iter().map(Column::Baseline);
        let columns: Vec<_> = networks.chain(baselines).collect();
        let rows = Metric::of(results.experiment()).into_iter().map(|metric| {
            let cells = columns.iter().map(|column| column.cell(metric, results));
            (metric, with_best(cells.collect(), metric))
        });
        let rows: Vec<_> = rows.collect();
        let missing = results.missing().len();
        let mut notes = vec![format!(
            "Mean ± standard deviation over {}, the folds of a seed averaged first; the best of a row in bold, unless all are equal.",
            count(results.planned_seeds(), "seed")
        )];
        let left_out = results.experiment().configurations();
        let left_out = left_out
            .into_iter()
            .filter(|c| !results.columns().contains(c));
        for column in left_out {
            notes.push(format!(
                "Left out: the column {}, because the plan does not specify such weights.",
                column.headings().join(", ")
            ));
        }
        for place in results.not_finite() {
            notes.push(format!(
                "Left out: {place}, whose predictions are not all finite."
            ));
        }
        if missing > 0 {
            notes.push(format!(
                "INCOMPLETE: {} missing; in cells with missing test sets, n is the number of seeds.",
                test_sets_are(missing)
            ));
        }
        let undefined = |cell: &Cell| cell.summary.is_none_or(|summary| summary.undefined > 0);
        let of_networks = |(_, cells): &(Metric, Vec<Cell>)| {
            cells[..results.columns().len()].iter().any(undefined)
        };
        if missing == 0 && rows.iter().any(of_networks) {
            notes.push(
                "n is the number of seeds for which a metric is defined, – means none: a correlation needs predictions that differ."
                    .to_owned(),
            );
        }
        let comparisons = results.comparisons();
        notes.extend(comparisons.iter().map(Comparison::to_string));
        notes.extend(results.differences().iter().map(Difference::to_string));
        if let Some(noise) = results.label_noise_mae() {
            notes.push(format!(
                "Labels that vary by their standard deviation about the true ones have an MAE of {noise:.3}."
            ));
        }
        Self {
            columns,
            rows,
            warning: constant(results),
            notes,
        }
    }

    /// Returns the headings of the columns.
    pub fn headings(&self) -> Vec<String> {
        let headings = self.columns.iter().map(|column| column.headings());
        headings.map(|levels| levels.join(", ")).collect()
    }

    /// Returns the name and cells of each row.
    pub fn rows(&self) -> Vec<(&'static str, Vec<TableCell>)> {
        let cell = |metric: Metric, (column, cell): (&Column, &Cell)| TableCell {
            text: cell.to_text(),
            best: cell.is_best(),
            published: match column {
                Column::Network(column) => published(*column, metric),
                Column::Baseline(_) => None,
            },
        };
        let row = |(metric, cells): &(Metric, Vec<Cell>)| {
            let cells = self.columns.iter().zip(cells);
            (
                metric.name(),
                cells.map(|both| cell(*metric, both)).collect(),
            )
        };
        self.rows.iter().map(row).collect()
    }

    /// Returns the notes on the table, first a warning if its numbers are misleading.
    pub fn notes(&self) -> impl Iterator<Item = &str> {
        self.warning.iter().chain(&self.notes).map(String::as_str)
    }

    /// Formats the table as Markdown, with its notes.
    pub fn to_markdown(&self) -> String {
        let warning = self
            .warning
            .iter()
            .flat_map(|text| [text.clone(), String::new()]);
        let mut lines: Vec<String> = warning.collect();
        lines.extend([
            format!("| Metric | {} |", self.headings().join(" | ")),
            format!("|---|{}", "---|".repeat(self.columns.len())),
        ]);
        for (metric, cells) in &self.rows {
            let cells: Vec<_> = cells.iter().map(Cell::to_markdown).collect();
            lines.push(format!("| {} | {} |", metric.name(), cells.join(" | ")));
        }
        for note in &self.notes {
            lines.extend([String::new(), note.clone()]);
        }
        lines.join("\n") + "\n"
    }

    /// Formats the table as rows of `metric,configuration,mean,std,seeds,undefined`, unrounded and not as percentages.
    pub fn to_csv(&self) -> String {
        let mut text = "metric,configuration,mean,std,seeds,undefined\n".to_owned();
        for (metric, cells) in &self.rows {
            for (column, cell) in self.columns.iter().zip(cells) {
                let Some(summary) = cell.summary else {
                    continue;
                };
                let std = summary.std.map_or(String::new(), |std| std.to_string());
                let (metric, column) = (metric.name().trim_end_matches(" [%]"), column.name());
                let Summary {
                    mean,
                    seeds,
                    undefined,
                    ..
                } = summary;
                text += &format!("{metric},{column},{mean},{std},{seeds},{undefined}\n");
            }
        }
        text
    }

    /// Formats the table as a LaTeX `tabular` with the rules of the package booktabs.
    pub fn to_latex(&self) -> String {
        let mut lines = vec![format!(
            "\\begin{{tabular}}{{l{}}}",
            "r".repeat(self.columns.len())
        )];
        lines.push("\\toprule".to_owned());
        lines.extend(self.latex_headings());
        lines.push("\\midrule".to_owned());
        for (metric, cells) in &self.rows {
            let name = metric.name().replace('%', "\\%").replace("r_s", "$r_s$");
            let cells: Vec<_> = cells.iter().map(Cell::to_latex).collect();
            lines.push(format!("{name} & {} \\\\", cells.join(" & ")));
        }
        lines.push("\\bottomrule".to_owned());
        lines.push("\\end{tabular}".to_owned());
        let notes = self.notes().map(|note| format!("% {note}"));
        notes.chain(lines).collect::<Vec<_>>().join("\n") + "\n"
    }

    /// Returns one line for each level of the headings; equal neighbours share a cell.
    fn latex_headings(&self) -> Vec<String> {
        let headings: Vec<_> = self
            .columns
            .iter()
            .map(|column| column.headings())
            .collect();
        let levels = headings.iter().map(Vec::len).max().unwrap_or(0);
        let line = |level: usize| {
            let up_to = |n: usize| headings[n].get(..=level);
            let mut cells = vec![if level == 0 { "Metric" } else { "" }.to_owned()];
            let mut n = 0;
            while n < headings.len() {
                let alike = (n..headings.len()).take_while(|&m| up_to(m) == up_to(n));
                let span = if up_to(n).is_some() { alike.count() } else { 1 };
                let words = up_to(n).map_or("", |words| &*words[level]);
                cells.push(match span {
                    1 => words.to_owned(),
                    _ => format!("\\multicolumn{{{span}}}{{c}}{{{words}}}"),
                });
                n += span;
            }
            cells.join(" & ") + " \\\\"
        };
        (0..levels).map(line).collect()
    }
}

/// Returns a text on the numbers of test sets, by column, for which the network predicts a constant.
fn constant(results: &Results) -> Option<String> {
    let found = results.constant();
    let of = |column: Configuration| {
        found
            .keys()
            .filter(move |place| place.configuration == column)
    };
    let each = results.planned_seeds() * results.folds();
    let columns = results.columns().iter();
    let columns = columns.filter(|column| of(**column).count() > 0);
    let columns: Vec<_> = columns
        .map(|&column| format!("column {} {} of {each}", column.name(), of(column).count()))
        .collect();
    let all = each * results.columns().len() - results.missing().len();
    (!found.is_empty()).then(|| {
        format!(
            "Constant predictions: on {} of {} the network gives the same answer for every pose (standard deviation below {} % \
             of the labels' range), and the metrics are those of a constant: {}.",
            found.len(),
            count(all, "test set"),
            100.0 * LEAST_SPREAD,
            columns.join(", ")
        )
    })
}

#[cfg(test)]
mod tests {
    use ppa_dataset::layout::Side;

    use super::super::configuration::Experiment;
    use super::super::predictions::Prediction;
    use super::*;

    fn test_set(error: f64) -> Vec<Prediction> {
        let row = |pose: &str, label: f64, prediction: f64| Prediction {
            patient: 1,
            side: Side::Right,
            pose: pose.to_owned(),
            frame: 0,
            angle_deg: None,
            label,
            prediction,
        };
        vec![row("a", 1.0, 1.0 + error), row("b", 3.0, 3.0 - error)]
    }

    fn filled(skip: usize) -> Results {
        let columns = Experiment::TwoC.configurations();
        let mut results = Results::new(Experiment::TwoC, columns, 1, &[1, 2]);
        for (n, place) in results.missing().into_iter().enumerate().skip(skip) {
            let column = n / 2;
            let error = [1.0, 0.75, 0.25, 0.2525][column] + 0.125 * (n % 2) as f64;
            let error = if column == 0 { 1.0 } else { error };
            results.insert(place, &test_set(error)).unwrap();
        }
        results
    }

    #[test]
    fn tables_have_the_papers_form() {
        let table = Table::complete(&filled(0)).unwrap();
        let markdown = table.to_markdown();
        let mae = markdown
            .lines()
            .find(|line| line.starts_with("| MAE"))
            .unwrap();
        assert_eq!(
            mae, "| MAE | 1.00±0.00 | 0.81±0.09 | **0.31**±0.09 | **0.31**±0.09 |",
            "two are the best of four"
        );
        let correlation = markdown.lines().find(|line| line.contains("r_s")).unwrap();
        assert!(
            correlation.starts_with("| Correlation r_s | – | 1.00±0.00"),
            "where all are equal none is the best: {correlation}"
        );
        let latex = table.to_latex();
        let headings = "Metric & from scratch & pretrained on ImageNet & \\multicolumn{2}{c}{pretrained on synthetic dataset} \\\\\n";
        assert!(latex.contains(headings), "{latex}");
        assert!(latex.contains("\n &  &  & unified camera view & camera view specific \\\\\n"));
        assert!(latex.contains("& \\textbf{0.31}{\\scriptsize$\\pm$0.09} &"));
        let csv = table.to_csv();
        assert!(csv.contains("\nMAE,scratch,1,0,2,0\n"), "{csv}");
        assert!(csv.contains("\nAccuracy,unified-all,1,0,2,0\n"), "{csv}");
    }

    #[test]
    fn incomplete_tables_are_refused_or_marked() {
        let results = filled(1);
        let refused = Table::complete(&results).unwrap_err();
        assert_eq!(
            refused.to_string(),
            "1 test set is missing, the first is experiment 2c, column scratch, seed 1, fold 0"
        );
        let markdown = Table::so_far(&results).to_markdown();
        assert!(
            markdown.contains("| MAE | 1.00 (n=1) | 0.81±0.09"),
            "{markdown}"
        );
        assert!(
            markdown.contains("INCOMPLETE: 1 test set is missing"),
            "{markdown}"
        );
        let latex = Table::so_far(&results).to_latex();
        assert!(latex.starts_with("% ") && latex.contains("% INCOMPLETE"));
    }
}
