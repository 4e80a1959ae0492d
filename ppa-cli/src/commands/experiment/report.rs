//! `ppa experiment report`: all results on one page.

use std::path::PathBuf;

use anyhow::Context;
use clap::Args;
use ppa_dataset::published::GrayImage16;
use ppa_dataset::write_whole;
use ppa_learn::evaluate::BaselineKind;
use ppa_learn::experiment::{
    Configuration, Experiment, ExperimentPlan, Metric, Prediction, Results, Runner, Table,
    TableCell, Variation,
};
use ppa_report::{
    ExperimentPart, ResultCell, WorstPose, errors_by_amount, errors_by_angle, experiments_page,
    predictions_by_label,
};
use serde::Serialize;

use super::run::tested;
use crate::output::Output;
use crate::output_files::ReplaceArgs;

/// Number of poses with the largest errors shown per experiment, one of each limb.
const WORST: usize = 6;
/// Side of their pictures in pixels.
const WORST_SIDE: usize = 96;

#[derive(Debug, Args)]
pub struct ReportArgs {
    /// Plan of the experiments
    plan: PathBuf,
    /// Folder of the training runs, as given to `ppa experiment 1`
    #[arg(long, value_name = "DIR")]
    runs: PathBuf,
    /// Page to write
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    #[command(flatten)]
    replace: ReplaceArgs,
}

#[derive(Debug, Serialize)]
struct Outcome {
    page: PathBuf,
    /// Findings of each experiment as sentences.
    findings: Vec<Finding>,
}

#[derive(Debug, Serialize)]
struct Finding {
    experiment: String,
    findings: Vec<String>,
    failures: Vec<String>,
}

pub fn run(args: &ReportArgs, output: Output) -> anyhow::Result<()> {
    args.replace
        .outputs()
        .file("--out", &args.out, &[".html"])?;
    let plan = ExperimentPlan::read(&args.plan)?;
    let runs = std::path::absolute(&args.runs)?;
    let parts = plan.experiments().into_iter();
    let parts = parts.map(|experiment| part(&plan, experiment, &runs));
    let parts: Vec<ExperimentPart> = parts.collect::<anyhow::Result<_>>()?;
    let text = experiments_page(&parts).context("a picture cannot be encoded")?;
    write_whole(&args.out, text.as_bytes())?;
    let finding = |part: ExperimentPart| Finding {
        experiment: part.title,
        findings: part.findings,
        failures: part.failures,
    };
    let outcome = Outcome {
        page: args.out.clone(),
        findings: parts.into_iter().map(finding).collect(),
    };
    output.print(&outcome, describe)
}

fn part(
    plan: &ExperimentPlan,
    experiment: Experiment,
    runs: &std::path::Path,
) -> anyhow::Result<ExperimentPart> {
    let runner = Runner::new(plan, experiment, runs)?;
    let mut results = runner.results()?;
    let failures = Table::complete(&results).err();
    let best = best(&results);
    if !results.is_empty() {
        runner.add_baselines(&mut results)?;
    }
    let table = Table::so_far(&results);
    let mut findings = Vec::new();
    if let Some(Ok(test)) = results.permutation_test() {
        findings.push(tested(&test));
    }
    findings.extend(results.comparisons().iter().map(ToString::to_string));
    findings.extend(results.differences().iter().map(ToString::to_string));
    let predictions = best.map_or(Vec::new(), |best| results.mean_predictions(best));
    Ok(ExperimentPart {
        title: title(experiment).to_owned(),
        findings,
        failures: failures.iter().map(ToString::to_string).collect(),
        headings: table.headings(),
        rows: table.rows().into_iter().map(row).collect(),
        notes: table.notes().map(str::to_owned).collect(),
        charts: charts(&results, best, &predictions),
        worst: worst(&runner, predictions)?,
    })
}

fn title(experiment: Experiment) -> &'static str {
    match experiment {
        Experiment::One => "Experiment 1: synthetic images alone",
        Experiment::TwoA => "Experiment 2a: finetuning on preparations",
        Experiment::TwoB => "Experiment 2b: finetuning on clinical images",
        Experiment::TwoC => "Experiment 2c: linear probing on preparations",
        Experiment::Persons => "Learning curve over persons",
        Experiment::Poses => "Learning curve over poses",
        Experiment::Shapes => "Experiment 1, tested with altered body shapes",
        Experiment::Ablations => "Ablations of experiment 1",
    }
}

/// The column with the lowest mean absolute error.
fn best(results: &Results) -> Option<Configuration> {
    let error = |column: &Configuration| {
        let mae = results.summary(*column, Metric::Mae)?.mean;
        Some((mae, *column))
    };
    let columns = results.columns().iter().filter_map(error);
    columns
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map(|best| best.1)
}

fn row((metric, cells): (&'static str, Vec<TableCell>)) -> (String, Vec<ResultCell>) {
    let cell = |cell: TableCell| ResultCell {
        text: cell.text,
        best: cell.best,
        published: cell.published.map(|[mean, std]| format!("{mean}±{std}")),
    };
    (metric.to_owned(), cells.into_iter().map(cell).collect())
}

/// Charts of the best column's predictions against labels, and of all columns' errors by angle if angles are known.
fn charts(
    results: &Results,
    best: Option<Configuration>,
    predictions: &[Prediction],
) -> Vec<(String, ppa_report::Chart)> {
    let Some(best) = best else {
        return Vec::new();
    };
    let points = predictions.iter().map(|p| [p.label, p.prediction]);
    let mut charts = vec![(
        format!(
            "{}: mean predictions of all seeds",
            best.headings().join(", ")
        ),
        predictions_by_label(points.collect()),
    )];
    let by_angle = results.columns().iter().map(|&column| {
        let means = results.error_by_angle(column).into_iter();
        let points = means.map(|(angle, error, _)| [angle, error]);
        (column.headings().join(", "), points.collect::<Vec<_>>())
    });
    let by_angle: Vec<_> = by_angle.filter(|(_, points)| !points.is_empty()).collect();
    if !by_angle.is_empty() {
        let caption = "mean absolute errors of single seeds by angle".to_owned();
        charts.push((caption, errors_by_angle(by_angle)));
    }
    charts.extend(learning_curve(results));
    charts
}

/// Chart of a learning curve: errors of its columns against the amount of data, and of the baselines, which use all data.
fn learning_curve(results: &Results) -> Option<(String, ppa_report::Chart)> {
    let (label, caption) = match results.experiment() {
        Experiment::Persons => (
            "persons",
            "persons to train with; baselines with all of them",
        ),
        Experiment::Poses => (
            "every n-th pose",
            "every n-th pose to train with; baselines with all of them",
        ),
        _ => return None,
    };
    let amount = |column: &Configuration| match column.variation {
        Variation::Persons(n) => Some(f64::from(n)),
        Variation::EveryPose(n) => Some(n.get() as f64),
        _ => None,
    };
    let point = |column: &Configuration| {
        let mae = results.summary(*column, Metric::Mae)?.mean;
        Some([amount(column)?, mae])
    };
    let mut network: Vec<[f64; 2]> = results.columns().iter().filter_map(point).collect();
    network.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let [first, .., last] = network[..] else {
        return None;
    };
    // The error of a constant prediction would compress the scale.
    let kinds = results.baselines().into_iter();
    let kinds = kinds.filter(|&kind| kind != BaselineKind::Constant);
    let baselines = kinds.filter_map(|kind| {
        let mae = results.of_baseline(kind, Metric::Mae)?;
        Some((kind.to_string(), vec![[first[0], mae], [last[0], mae]]))
    });
    let series = [("network".to_owned(), network)]
        .into_iter()
        .chain(baselines);
    let chart = errors_by_amount(label, series.collect());
    Some((caption.to_owned(), chart))
}

fn worst(runner: &Runner, mut predictions: Vec<Prediction>) -> anyhow::Result<Vec<WorstPose>> {
    let error = |p: &Prediction| (p.prediction - p.label).abs();
    predictions.sort_by(|a, b| error(b).total_cmp(&error(a)));
    let mut limbs = std::collections::BTreeSet::new();
    predictions.retain(|p| limbs.insert((p.patient, p.side)));
    predictions.truncate(WORST);
    let worst = predictions.into_iter().map(|prediction| {
        let images = runner
            .images_of(&prediction.moment())?
            .into_iter()
            .map(|image| {
                let raster = image.load(WORST_SIDE)?;
                anyhow::Ok(GrayImage16 {
                    width: raster.width() as u32,
                    height: raster.height() as u32,
                    pixels: raster.into_values(),
                })
            });
        Ok(WorstPose {
            caption: caption(&prediction),
            images: images.collect::<anyhow::Result<_>>()?,
        })
    });
    worst.collect()
}

fn caption(prediction: &Prediction) -> String {
    let pose = match prediction.angle_deg {
        Some(angle_deg) => format!(
            "patient {} {}, {angle_deg} degrees",
            prediction.patient,
            prediction.side.letter()
        ),
        None => prediction.moment().to_string(),
    };
    let Prediction {
        label, prediction, ..
    } = prediction;
    format!("{pose}: label {label}, prediction {prediction:.2}")
}

fn describe(outcome: &Outcome) -> String {
    let mut lines = Vec::new();
    for Finding {
        experiment,
        findings,
        failures,
    } in &outcome.findings
    {
        lines.push(experiment.clone());
        let sentences = failures.iter().chain(findings);
        lines.extend(sentences.map(|sentence| format!("  {sentence}")));
    }
    lines.push(format!("page: {}", outcome.page.display()));
    lines.join("\n")
}
