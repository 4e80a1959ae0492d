//! The cells of a table.

use super::metric::Metric;
use super::results::{Results, Summary};

/// Cell of a table as it is printed.
#[derive(Debug, Clone)]
pub struct Cell {
    /// The value; `None` if there is no result yet.
    pub summary: Option<Summary>,
    mean: String,
    std: Option<String>,
    best: bool,
    /// Number of seeds included, if fewer than planned.
    of_seeds: Option<usize>,
}

impl Cell {
    pub fn new(summary: Option<Summary>, metric: Metric, results: &Results) -> Self {
        let print = |value: f64| format!("{:.2}", value * metric.scale());
        let seeds = summary.map_or(0, |summary| summary.seeds);
        Self {
            summary,
            mean: summary.map_or("–".to_owned(), |summary| print(summary.mean)),
            std: summary.and_then(|summary| summary.std).map(print),
            best: false,
            of_seeds: (0 < seeds && seeds < results.planned_seeds()).then_some(seeds),
        }
    }

    /// A value that does not depend on a seed.
    pub fn without_seeds(value: Option<f64>, metric: Metric) -> Self {
        let print = |value: f64| format!("{:.2}", value * metric.scale());
        Self {
            summary: value.map(|mean| Summary {
                mean,
                std: None,
                seeds: 1,
                undefined: 0,
            }),
            mean: value.map_or("–".to_owned(), print),
            std: None,
            best: false,
            of_seeds: None,
        }
    }

    pub fn is_best(&self) -> bool {
        self.best
    }

    pub fn to_text(&self) -> String {
        self.with_mean(self.mean.clone())
    }

    pub fn to_markdown(&self) -> String {
        self.with_mean(match self.best {
            true => format!("**{}**", self.mean),
            false => self.mean.clone(),
        })
    }

    /// Returns the given mean and the text that follows it.
    fn with_mean(&self, mean: String) -> String {
        let std = self
            .std
            .as_ref()
            .map_or(String::new(), |std| format!("±{std}"));
        let n = self.of_seeds.map_or(String::new(), |n| format!(" (n={n})"));
        mean + &std + &n
    }

    pub fn to_latex(&self) -> String {
        let mean = match (self.best, self.summary) {
            (true, _) => format!("\\textbf{{{}}}", self.mean),
            (false, Some(_)) => self.mean.clone(),
            (false, None) => "--".to_owned(),
        };
        let std = self.std.as_ref();
        let std = std.map_or(String::new(), |std| format!("{{\\scriptsize$\\pm${std}}}"));
        let n = self
            .of_seeds
            .map_or(String::new(), |n| format!(" ($n={n}$)"));
        mean + &std + &n
    }
}

/// Marks the best cells. Cells that print the same number are equally good; if all print the same, none is marked.
pub fn with_best(mut cells: Vec<Cell>, metric: Metric) -> Vec<Cell> {
    let means = cells.iter().filter_map(|cell| Some(cell.summary?.mean));
    let best = match metric.lower_is_better() {
        true => means.reduce(f64::min),
        false => means.reduce(f64::max),
    };
    let best = cells
        .iter()
        .find(|cell| best.is_some() && cell.summary.map(|summary| summary.mean) == best)
        .map(|cell| cell.mean.clone());
    let is_best = |cell: &Cell| cell.summary.is_some() && Some(&cell.mean) == best.as_ref();
    let mut filled = cells.iter().filter(|cell| cell.summary.is_some());
    if filled.all(is_best) {
        return cells;
    }
    for cell in &mut cells {
        cell.best = is_best(cell);
    }
    cells
}
