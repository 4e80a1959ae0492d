//! `ppa metrics`: predictions against labels.

use std::path::PathBuf;

use anyhow::Context;
use clap::Args;
use ppa_core::text::number;
use ppa_metrics::{Report, evaluate};
use serde::Deserialize;

use crate::output::Output;

#[derive(Debug, Args)]
pub struct MetricsArgs {
    /// CSV with the columns id, label, prediction
    csv: PathBuf,
}

#[derive(Debug, Deserialize)]
struct Row {
    label: f64,
    prediction: f64,
}

pub fn run(args: &MetricsArgs, output: Output) -> anyhow::Result<()> {
    let rows: Vec<Row> = super::read_csv(&args.csv)?;
    let labels: Vec<f64> = rows.iter().map(|row| row.label).collect();
    let predictions: Vec<f64> = rows.iter().map(|row| row.prediction).collect();
    let report = evaluate(&labels, &predictions).with_context(|| args.csv.display().to_string())?;
    output.print(&report, describe)
}

fn describe(report: &Report) -> String {
    let percent = |share: Option<f64>| {
        share.map_or("not defined".to_owned(), |share| {
            format!("{:.2} %", 100.0 * share)
        })
    };
    let spearman = report.spearman.map_or("not defined".to_owned(), |rho| {
        format!("{:.4}", number(rho))
    });
    let constant = report.constant_prediction;
    let mut lines: Vec<String> = constant.iter().map(ToString::to_string).collect();
    lines.extend([
        format!("n                    {}", report.n),
        format!("MSE                  {:.4}", report.mse),
        format!("MAE                  {:.4}", report.mae),
        format!("Spearman             {spearman}"),
        format!("Accuracy             {:.2} %", 100.0 * report.accuracy),
        format!(
            "Diagnostic Accuracy  {:.2} %",
            100.0 * report.diagnostic_accuracy
        ),
        format!("Sensitivity          {}", percent(report.sensitivity)),
        format!("Specificity          {}", percent(report.specificity)),
    ]);
    lines.join("\n")
}
