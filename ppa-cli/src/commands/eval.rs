//! `ppa eval`: evaluation of a trained network.

use std::path::PathBuf;
use std::sync::Arc;

use anyhow::Context;
use clap::Args;
use ppa_dataset::labels::LabelName;
use ppa_learn::DeviceName;
use ppa_learn::data::{Images, check_split};
use ppa_learn::evaluate::{
    Baselines, CorrectionScores, EVALUATION_TABLES, Evaluation, Row, Scores, write_evaluation,
};
use ppa_learn::train::{LogRow, Source, predict, read_log, samples, trained};
use ppa_report::Chart;

use ppa_core::text::number;

use crate::findings::repeat_of_datasets;
use crate::interrupt::{NOTHING_WRITTEN, ends_at_once};
use crate::output::{Output, working};
use crate::output_files::ReplaceArgs;

#[derive(Debug, Args)]
pub struct EvalArgs {
    /// Folder of a finished `ppa train`
    run: PathBuf,
    /// Dataset to use in place of the configuration's `[[evaluation]]`
    #[arg(long, value_name = "DIR")]
    dataset: Option<PathBuf>,
    /// Persons of --dataset [default: all]
    #[arg(
        long,
        value_name = "N,...",
        value_delimiter = ',',
        requires = "dataset"
    )]
    patients: Option<Vec<u32>>,
    /// Label set of --dataset: labels.NAME.json [default: labels.json]
    #[arg(long, value_name = "NAME", requires = "dataset")]
    labels: Option<LabelName>,
    /// Device to run the network on: cpu, cuda or cuda:N
    #[arg(long, default_value_t)]
    device: DeviceName,
    /// Folder for predictions, metrics and figures [default: evaluation, in the run's folder]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    replace: ReplaceArgs,
}

/// Names of the charts; the last one exists only if angles are known.
const CHARTS: [&str; 6] = [
    "learning_curve",
    "scatter",
    "confusion",
    "confusion_half_steps",
    "calibration",
    "errors_by_angle",
];

pub fn run(args: &EvalArgs, output: Output) -> anyhow::Result<()> {
    let out = args.out.clone().unwrap_or(args.run.join("evaluation"));
    let mut outputs = args.replace.outputs();
    let charts = CHARTS.map(|name| [format!("{name}.svg"), format!("{name}.png")]);
    let tables = EVALUATION_TABLES.map(str::to_owned);
    for name in tables.into_iter().chain(charts.into_iter().flatten()) {
        outputs.file_in_new_folder("--out", &out.join(name), &[])?;
    }
    let stoppable = ends_at_once(NOTHING_WRITTEN)?;
    let (config, network) = trained(&args.run)?;
    let network = network.to_device(&args.device.open()?)?;
    let sources = match &args.dataset {
        Some(dataset) => vec![Source {
            dataset: dataset.clone(),
            patients: args.patients.clone(),
            shapes: None,
            every_pose: None,
            labels: args.labels.clone(),
        }],
        None => config.evaluation.clone(),
    };
    let used = config.training.iter().chain(&sources);
    repeat_of_datasets(used.map(|source| &*source.dataset))?;
    let tested = samples(&config, &sources)?;
    anyhow::ensure!(
        !tested.is_empty(),
        "the configuration has no [[evaluation]]; give --dataset"
    );
    let training = samples(&config, &config.training)?;
    check_split(&training, &tested)?;
    let spinner = working("evaluating");
    let images = Arc::new(Images::new(tested, config.side, 0)?);
    let predictions = predict(&network, &images, config.batch_size, config.workers)?;
    let rows = Row::of(images.samples(), &predictions);
    let evaluation = Evaluation::of(&rows)?;
    let baselines = Baselines::of(&training, images.samples(), &rows)?;
    spinner.finish_and_clear();
    let evaluation = Evaluation {
        baselines: Some(baselines),
        ..evaluation
    };
    let log = read_log(&args.run.join("log.jsonl"))?;
    let drawn = draw_charts(&log, &rows, &evaluation);
    drop(stoppable);
    let writing = || format!("writing into {}", out.display());
    write_evaluation(&out, &rows, &evaluation).with_context(writing)?;
    for (name, chart) in CHARTS.into_iter().zip(drawn) {
        chart.write(&out, name).with_context(writing)?;
    }
    output.print(&evaluation, describe)
}

/// Draws the charts in the order of [`CHARTS`].
fn draw_charts(log: &[LogRow], rows: &[Row], evaluation: &Evaluation) -> Vec<Chart> {
    let scalar = |tag: &str| {
        let rows = log.iter();
        let points = rows.filter_map(|row| Some([row.step as f64, *row.scalars.get(tag)?]));
        points.collect()
    };
    let means = |means: &[(f64, f64, usize)]| means.iter().map(|&(x, y, _)| [x, y]).collect();
    let by_label = means(&evaluation.calibration);
    let by_prediction = means(&evaluation.calibration_by_prediction);
    let mut charts = vec![
        ppa_report::learning_curve(
            scalar("training/loss"),
            scalar("evaluation/mse"),
            scalar("evaluation/mae"),
        ),
        ppa_report::predictions_by_label(
            rows.iter().map(|row| [row.label, row.prediction]).collect(),
        ),
        ppa_report::confusion(&evaluation.confusion),
        ppa_report::confusion(&evaluation.confusion_half_steps),
        ppa_report::calibration(by_label, by_prediction),
    ];
    if !evaluation.error_by_angle.is_empty() {
        let series = ("images".to_owned(), means(&evaluation.error_by_angle));
        charts.push(ppa_report::errors_by_angle(vec![series]));
    }
    charts
}

fn describe(evaluation: &Evaluation) -> String {
    let constant = evaluation.constant_prediction;
    let mut lines: Vec<String> = constant.iter().map(ToString::to_string).collect();
    lines.push(format!(
        "{:<22}{:>6}{:>8}{:>8}{:>10}{:>10}{:>12}{:>13}{:>13}",
        "", "n", "MSE", "MAE", "Spearman", "Accuracy", "Diagnostic", "Sensitivity", "Specificity"
    ));
    lines.push(line("images", &evaluation.images));
    lines.push(line("poses", &evaluation.poses));
    let several = evaluation.persons.iter().any(|person| person.dataset > 1);
    for person in &evaluation.persons {
        let mut name = format!("patient {}", person.patient);
        if several {
            name = format!("dataset {}, {name}", person.dataset);
        }
        lines.push(line(&name, &person.scores));
    }
    if let Some(baselines) = &evaluation.baselines {
        for baseline in &baselines.baselines {
            lines.push(line(&baseline.kind.to_string(), &baseline.scores));
        }
        if let Some(noise) = baselines.label_noise_mae {
            lines.push(format!("MAE of the labels' own variation: {noise:.3}"));
        }
        lines.push(baselines.to_string());
    }
    lines.extend(correction(evaluation));
    if let Some(spread) = evaluation.frame_spread {
        lines.push(format!(
            "Frames of a pose differ by {spread:.3} (standard deviation)."
        ));
    }
    if let (Some(delta), Some(margin)) = (evaluation.pose_delta, evaluation.pose_margin_accuracy) {
        let margin = percent(Some(margin));
        lines.push(format!(
            "Pose Delta {:.3}, Pose Margin Accuracy {margin}",
            number(delta)
        ));
    }
    lines.push("Images by class of the label (rows) and prediction (columns), 1 to 3:".into());
    for row in evaluation.confusion {
        lines.push(row.map(|n| format!("{n:>8}")).concat());
    }
    lines.join("\n")
}

fn correction(evaluation: &Evaluation) -> Option<String> {
    let CorrectionScores {
        mae_deg, bias_deg, ..
    } = evaluation.correction?;
    let without = evaluation.baselines.as_ref()?.correction_mae_deg;
    let without = without.map(|mae| {
        format!("; from the true angle to the mean best angle of the training limbs: {mae:.1}")
    });
    let without = without.unwrap_or_default();
    Some(format!(
        "Correction (medial rotation to the best pose): MAE {mae_deg:.1} degrees, mean error {bias_deg:+.1}{without}"
    ))
}

fn percent(value: Option<f64>) -> String {
    value.map_or("-".to_owned(), |v| format!("{:.1} %", 100.0 * v))
}

fn line(name: &str, scores: &Scores) -> String {
    let score = |value: Option<f64>| value.map_or("-".to_owned(), |v| format!("{:.3}", number(v)));
    format!(
        "{name:<22}{:>6}{:>8}{:>8}{:>10}{:>10}{:>12}{:>13}{:>13}",
        scores.n,
        score(scores.mse),
        score(scores.mae),
        score(scores.spearman),
        percent(scores.accuracy),
        percent(scores.diagnostic_accuracy),
        percent(scores.sensitivity),
        percent(scores.specificity)
    )
}
