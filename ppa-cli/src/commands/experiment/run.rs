//! `ppa experiment 1` to `2c` and `all`: training runs and tables of the paper's experiments.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use clap::Args;
use ppa_core::Part;
use ppa_core::text::{count, number};
use ppa_dataset::write_whole;
use ppa_learn::experiment::{
    Begun, Comparison, Configuration, Difference, Event, Experiment, ExperimentPlan, Runner, Table,
    Training,
};
use ppa_metrics::{ConstantPrediction, PermutationTest};
use serde::Serialize;

use crate::allocator::keep_freed_memory;
use crate::findings::repeat_of_datasets;
use crate::interrupt::Interrupt;
use crate::output::{Output, bar};
use crate::output_files::{ReplaceArgs, require_same, require_writable};
use crate::shard::shard;
use crate::stderr;

#[derive(Debug, Args)]
#[command(after_long_help = "\
Each training run has a folder of its own below --out. The command may be stopped at any time and started again: finished \
runs stay, others resume. On several machines that share the folder each makes a shard; the last command, without \
--shard, finds everything made and writes the tables.

  ppa experiment 2a plan.toml --out runs --shard 3/10
  ppa experiment 2a plan.toml --out runs

`ppa experiment all` makes all experiments of the plan, and takes the same options except --columns.

A plan:

  seeds = 10                          # repetitions
  imagenet_weights = \"b0.safetensors\" # or .pth; without it, no such columns
  [training]                          # keys of `ppa train`
  preset = \"paper\"                    # or \"standard\", \"quick\"
  [finetuning]                        # where 2a to 2c differ from [training]
  steps = 50000
  [synthetic]
  dataset = \"synthetic\"
  folds = 3
  test_limbs = 3
  [preparations]                      # of 2a and 2c
  dataset = \"preparations\"
  folds = 2
  [clinical]                          # of 2b
  dataset = \"clinical\"
  folds = 3
  [learning_curves]
  persons = [5, 10, 17]               # numbers, for `experiment persons`
  every_pose = [4, 2, 1]              # every n-th angle, for `... poses`")]
pub struct RunArgs {
    /// Plan of the experiments
    plan: PathBuf,
    /// Folder of the training runs and tables
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Run only shard k of n, and write no tables
    #[arg(long, value_name = "K/N")]
    shard: Option<Part>,
    /// Run only these columns of the table, by the names of their training folders (such as scratch,specific-size), and write no tables
    #[arg(
        long,
        value_name = "NAMES",
        value_delimiter = ',',
        conflicts_with = "so_far"
    )]
    columns: Vec<String>,
    /// Write tables of the results so far, marked as incomplete, without training
    #[arg(long, conflicts_with = "shard")]
    so_far: bool,
    #[command(flatten)]
    replace: ReplaceArgs,
}

/// File extensions of the tables of an experiment.
const TABLES: [&str; 4] = ["md", "csv", "tex", "json"];

#[derive(Debug, Serialize)]
struct Outcome {
    experiment: &'static str,
    /// Test sets on which the network predicts a constant.
    constant_prediction: Vec<ConstantTestSet>,
    finished: bool,
    missing: usize,
    /// Training runs that are started but not finished.
    begun: Vec<Begun>,
    permutation_test: Option<PermutationTest>,
    /// Each column compared with predictions without a network.
    comparisons: Vec<Comparison>,
    /// Columns compared with the first one, from which each differs in one thing.
    differences: Vec<Difference>,
    table: Option<String>,
}

#[derive(Debug, Serialize)]
struct ConstantTestSet {
    test_set: String,
    #[serde(flatten)]
    constant: ConstantPrediction,
}

/// All experiments of a plan.
#[derive(Debug, Serialize)]
struct Outcomes {
    experiments: Vec<Outcome>,
}

/// Runs one experiment.
pub fn run(experiment: Experiment, args: &RunArgs, output: Output) -> anyhow::Result<()> {
    let plan = ExperimentPlan::read(&args.plan)?;
    let (mut outcomes, stopped) = carry_out_all(&plan, &[experiment], args)?;
    if (stopped.is_none() || output.json)
        && let Some(outcome) = outcomes.pop()
    {
        output.print(&outcome, describe)?;
    }
    stopped.map_or(Ok(()), Err)
}

/// Runs all experiments of the plan, one after the other.
pub fn run_all(args: &RunArgs, output: Output) -> anyhow::Result<()> {
    if !args.columns.is_empty() {
        bail!("--columns names columns of one experiment and cannot be used with all");
    }
    let plan = ExperimentPlan::read(&args.plan)?;
    let (experiments, stopped) = carry_out_all(&plan, &plan.experiments(), args)?;
    if stopped.is_none() || output.json {
        output.print(&Outcomes { experiments }, |all| {
            let texts: Vec<String> = all.experiments.iter().map(describe).collect();
            texts.join("\n\n")
        })?;
    }
    stopped.map_or(Ok(()), Err)
}

/// Checks the data of all experiments, then runs one after the other; returns the error to report if they were stopped.
fn carry_out_all(
    plan: &ExperimentPlan,
    experiments: &[Experiment],
    args: &RunArgs,
) -> anyhow::Result<(Vec<Outcome>, Option<anyhow::Error>)> {
    let targets = experiments
        .iter()
        .map(|&experiment| plan.target(experiment));
    let targets: Vec<_> = targets.collect::<Result<_, _>>()?;
    let mut datasets: Vec<&Path> = targets.iter().map(|target| &*target.dataset).collect();
    datasets.insert(0, &plan.synthetic.dataset);
    repeat_of_datasets(datasets.into_iter())?;
    // An absolute path: unfinished training runs compare the paths of the weights that they started from.
    let out = std::path::absolute(&args.out)?;
    let part = shard(args.shard)?.part(|| Ok(None))?;
    let left_out = |e: &Experiment| plan.configurations(*e).len() < e.configurations().len();
    if experiments.iter().any(left_out) {
        stderr::warning("the plan does not specify imagenet_weights: their column is left out");
    }
    require_writable("--out", &out)?;
    let prepared = experiments
        .iter()
        .map(|&experiment| Prepared::new(plan, experiment, &out, part, args));
    let prepared: Vec<_> = prepared.collect::<anyhow::Result<_>>()?;
    let interrupt = Interrupt::listen()?;
    keep_freed_memory();
    let mut outcomes = Vec::new();
    for one in &prepared {
        let outcome = carry_out(one, part, args, &interrupt)?;
        let stopped = !outcome.finished && !args.so_far;
        outcomes.push(outcome);
        if stopped {
            let error = interrupt.stopped("; repeat the command to resume the training");
            return Ok((outcomes, Some(error)));
        }
    }
    Ok((outcomes, None))
}

/// An experiment whose data have been checked.
struct Prepared<'a> {
    experiment: Experiment,
    runner: Runner<'a>,
    /// Indices of the runs of the chosen columns.
    chosen: Vec<usize>,
    /// Whether this process makes all of it.
    whole: bool,
    tables: [PathBuf; 4],
}

impl<'a> Prepared<'a> {
    fn new(
        plan: &'a ExperimentPlan,
        experiment: Experiment,
        out: &'a Path,
        part: Part,
        args: &RunArgs,
    ) -> anyhow::Result<Self> {
        let runner = Runner::new(plan, experiment, out)?;
        let tables = TABLES.map(|ending| {
            let name = format!("experiment_{}.{ending}", experiment.name());
            out.join(name)
        });
        let chosen = chosen(&runner, &plan.configurations(experiment), &args.columns)?;
        let whole = part == Part::WHOLE && args.columns.is_empty();
        if !args.so_far {
            if whole && !runner.results()?.missing().is_empty() {
                require_no_tables(&tables, args.replace)?;
            }
            runner.check_data(|n| chosen.contains(&n))?;
        }
        Ok(Self {
            experiment,
            runner,
            chosen,
            whole,
            tables,
        })
    }
}

/// Runs the trainings of an experiment and writes its tables.
fn carry_out(
    prepared: &Prepared,
    part: Part,
    args: &RunArgs,
    interrupt: &Interrupt,
) -> anyhow::Result<Outcome> {
    let &Prepared {
        experiment,
        ref runner,
        ref chosen,
        whole,
        ref tables,
    } = prepared;
    let finished = !args.so_far && train(runner, chosen, part, interrupt)?;

    let mut results = runner.results()?;
    if !results.is_empty() && (args.so_far || (finished && whole)) {
        runner.add_baselines(&mut results)?;
    }
    let table = match (args.so_far, finished && whole) {
        (true, _) => Some(Table::so_far(&results)),
        (false, true) => Some(
            Table::complete(&results)
                .context("--so-far writes tables that are marked as incomplete")?,
        ),
        (false, false) => None,
    };
    // There may be no seed yet that is complete in both columns.
    let permutation_test = match (&table, results.permutation_test()) {
        (Some(_), Some(test)) if args.so_far => test.ok(),
        (Some(_), Some(test)) => Some(test?),
        _ => None,
    };
    let constant = results.constant().iter();
    let constant = constant.map(|(place, &constant)| ConstantTestSet {
        test_set: place.to_string(),
        constant,
    });
    let outcome = Outcome {
        experiment: experiment.name(),
        constant_prediction: constant.collect(),
        finished,
        begun: runner.begun()?,
        missing: results.missing().len(),
        permutation_test,
        comparisons: results.comparisons(),
        differences: results.differences(),
        table: table.as_ref().map(Table::to_markdown),
    };
    if let Some(table) = &table {
        let json = serde_json::to_string_pretty(&outcome)?;
        let texts = [table.to_markdown(), table.to_csv(), table.to_latex(), json];
        for (path, text) in tables.iter().zip(&texts) {
            require_same(path, text.as_bytes(), args.replace)?;
        }
        for (path, text) in tables.iter().zip(&texts) {
            write_whole(path, text.as_bytes())?;
        }
    }
    Ok(outcome)
}

/// Refuses existing tables now rather than after training.
fn require_no_tables(tables: &[PathBuf], replace: ReplaceArgs) -> anyhow::Result<()> {
    let there = tables.iter().find(|path| path.exists());
    match there {
        Some(path) if !replace.is_given() => bail!(
            "{} exists and would be replaced after the training runs: give --replace, or move it away",
            path.display()
        ),
        _ => Ok(()),
    }
}

/// Indices of the runs of the named columns; all of them if none is named.
fn chosen(
    runner: &Runner,
    columns: &[Configuration],
    names: &[String],
) -> anyhow::Result<Vec<usize>> {
    let all: Vec<String> = columns.iter().map(|column| column.name()).collect();
    if let Some(unknown) = names.iter().find(|name| !all.contains(name)) {
        bail!(
            "--columns: found {unknown}, expected some of {}",
            all.join(", ")
        );
    }
    let is_chosen = |training: &Training| match training {
        Training::Run { configuration, .. } => {
            names.is_empty() || names.contains(&configuration.name())
        }
        Training::Pretraining { .. } => false,
    };
    let runs = runner.runs().into_iter().enumerate();
    Ok(runs
        .filter(|(_, training)| is_chosen(training))
        .map(|(n, _)| n)
        .collect())
}

/// Runs a share of the chosen runs; returns whether they finished.
fn train(
    runner: &Runner,
    chosen: &[usize],
    part: Part,
    interrupt: &Interrupt,
) -> anyhow::Result<bool> {
    let bar = bar("training");
    let share = part.share(chosen.len() as u64);
    let share = &chosen[share.start as usize..share.end as usize];
    let finished = runner.run(
        |n| share.contains(&n),
        interrupt.flag(),
        |event| match event {
            Event::Begins {
                training,
                number,
                of,
            } => {
                bar.suspend(|| stderr::note(&format!("{number} of {of}: {training}")));
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
            "the requested training runs are finished; {} missing from the whole experiment",
            match outcome.missing {
                1 => "1 test set is".to_owned(),
                n => format!("{n} test sets are"),
            }
        ),
        (None, false) => "stopped; repeat the command to resume".to_owned(),
    }];
    let begun = outcome.begun.iter();
    lines.extend(begun.map(|begun| {
        let steps = count(begun.steps, "step");
        format!(
            "not finished: {} with {} of {steps}",
            begun.training, begun.step
        )
    }));
    let test = outcome.permutation_test.as_ref();
    lines.extend(test.map(|test| format!("\n{}", tested(test))));
    lines.join("\n")
}

/// Describes the result of the paper's test in a sentence.
pub(super) fn tested(test: &PermutationTest) -> String {
    format!(
        "MAE from scratch minus pretrained over {}: {:.3}, exact one-sided p = {:.4} ({})",
        count(test.patterns.ilog2(), "seed"),
        number(test.mean_difference),
        test.p_one_sided,
        count(test.patterns, "sign pattern")
    )
}
