//! `ppa experiment`: the paper's experiments, from one plan.

use std::path::PathBuf;

use anyhow::Context;
use clap::{Args, ValueEnum};
use ppa_dataset::write_whole;
use ppa_learn::experiment::{Event, Experiment, ExperimentPlan, Runner, Table};
use ppa_metrics::PermutationTest;
use ppa_xray::Part;
use serde::Serialize;

use crate::interrupt::on_interrupt;
use crate::output::{Output, bar};
use crate::shard::shard;

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Which {
    /// Synthetic images alone, with and without variants of the skin (table 1)
    #[value(name = "1")]
    One,
    /// Finetuning on preparations (table 2)
    #[value(name = "2a")]
    TwoA,
    /// Finetuning on clinical images (table 3)
    #[value(name = "2b")]
    TwoB,
    /// Linear probing on preparations (table 4)
    #[value(name = "2c")]
    TwoC,
}

#[derive(Debug, Args)]
#[command(after_long_help = "\
Each training is a folder of its own below --out. A run may be stopped at any moment and started again: what is finished \
stays, what was begun goes on. On several machines that share the folder each makes a shard; the last command, without \
--shard, finds everything made and writes the tables.

  ppa experiment 2a plan.toml --out runs --shard 3/10
  ppa experiment 2a plan.toml --out runs

A plan:

  seeds = 10                          # repetitions
  imagenet_weights = \"b0.safetensors\" # or .pth; its columns are left out without it
  [training]
  preset = \"paper\"                    # or \"quick\", and what differs, as in `ppa train`
  [synthetic]
  dataset = \"synthetic\"
  folds = 3
  test_limbs = 3
  [preparations]                      # of 2a and 2c
  dataset = \"preparations\"
  folds = 2
  [clinical]                          # of 2b
  dataset = \"clinical\"
  folds = 3")]
pub struct ExperimentArgs {
    /// The experiment
    which: Which,
    /// Plan of the experiments
    plan: PathBuf,
    /// Folder of the trainings and tables
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Make only shard k of n, and no tables
    #[arg(long, value_name = "K/N")]
    shard: Option<Part>,
    /// Write tables of what there is, marked as incomplete, and train nothing
    #[arg(long, conflicts_with = "shard")]
    so_far: bool,
}

#[derive(Debug, Serialize)]
struct Outcome {
    experiment: &'static str,
    finished: bool,
    missing: usize,
    permutation_test: Option<PermutationTest>,
    table: Option<String>,
}

pub fn run(args: &ExperimentArgs, output: Output) -> anyhow::Result<()> {
    let plan = ExperimentPlan::read(&args.plan)?;
    let experiment = match args.which {
        Which::One => Experiment::One,
        Which::TwoA => Experiment::TwoA,
        Which::TwoB => Experiment::TwoB,
        Which::TwoC => Experiment::TwoC,
    };
    // A whole path: begun trainings compare the paths of the weights that they began with.
    let out = std::path::absolute(&args.out)?;
    let runner = Runner::new(&plan, experiment, &out)?;
    let part = shard(args.shard)?.part(|| Ok(None))?;
    if plan.configurations(experiment).len() < experiment.configurations().len() {
        eprintln!("the plan names no imagenet_weights: their column is left out");
    }
    let finished = !args.so_far && train(&runner, part)?;

    let results = runner.results()?;
    let table = match (args.so_far, finished && part == Part::WHOLE) {
        (true, _) => Some(Table::so_far(&results)),
        (false, true) => Some(
            Table::complete(&results)
                .context("--so-far writes tables that are marked as incomplete")?,
        ),
        (false, false) => None,
    };
    // So far there may be no seed yet that is complete in both columns.
    let permutation_test = match (&table, results.permutation_test()) {
        (Some(_), Some(test)) if args.so_far => test.ok(),
        (Some(_), Some(test)) => Some(test?),
        _ => None,
    };
    let outcome = Outcome {
        experiment: experiment.name(),
        finished,
        missing: results.missing().len(),
        permutation_test,
        table: table.as_ref().map(Table::to_markdown),
    };
    if let Some(table) = &table {
        let json = serde_json::to_string_pretty(&outcome)?;
        for (ending, text) in [
            ("md", table.to_markdown()),
            ("csv", table.to_csv()),
            ("tex", table.to_latex()),
            ("json", json),
        ] {
            let name = format!("experiment_{}.{ending}", experiment.name());
            write_whole(&out.join(name), text.as_bytes())?;
        }
    }
    output.print(&outcome, describe)
}

/// Carries out a share of the runs; whether it came to their end.
fn train(runner: &Runner, part: Part) -> anyhow::Result<bool> {
    let stop = on_interrupt()?;
    let bar = bar("training");
    let share = part.share(runner.runs().len() as u64);
    let finished = runner.run(
        |n| share.contains(&(n as u64)),
        &stop,
        |event| match event {
            Event::Begins { unit, number, of } => {
                bar.suspend(|| eprintln!("{number} of {of}: {unit}"));
                bar.reset();
            }
            Event::Step(progress) => {
                bar.set_length(progress.steps);
                bar.set_position(progress.step);
            }
        },
    )?;
    bar.finish_and_clear();
    Ok(finished)
}

fn describe(outcome: &Outcome) -> String {
    let mut lines = vec![match (&outcome.table, outcome.finished) {
        (Some(table), _) => table.trim_end().to_owned(),
        (None, true) => format!(
            "this shard is finished; {} test sets of the whole experiment are missing",
            outcome.missing
        ),
        (None, false) => "stopped; the same command goes on".to_owned(),
    }];
    if let Some(test) = &outcome.permutation_test {
        lines.push(format!(
            "\nMAE from scratch minus pretrained over {} seeds: {:.3}, exact one-sided p = {:.4} ({} sign patterns)",
            test.patterns.ilog2(), test.mean_difference, test.p_one_sided, test.patterns
        ));
    }
    lines.join("\n")
}
