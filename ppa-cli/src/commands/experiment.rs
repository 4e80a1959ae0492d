//! `ppa experiment`: the paper's experiments, from one plan.

mod report;
mod run;

use clap::Subcommand;
use ppa_learn::experiment::Experiment;

use crate::output::Output;

#[derive(Debug, Subcommand)]
pub enum ExperimentCommand {
    /// Synthetic images alone, with and without skin variants (table 1)
    #[command(name = "1")]
    One(run::RunArgs),
    /// Finetuning on preparations (table 2)
    #[command(name = "2a")]
    TwoA(run::RunArgs),
    /// Finetuning on clinical images (table 3)
    #[command(name = "2b")]
    TwoB(run::RunArgs),
    /// Linear probing on preparations (table 4)
    #[command(name = "2c")]
    TwoC(run::RunArgs),
    /// Learning curve: experiment 1 with fewer persons to train with
    Persons(run::RunArgs),
    /// Learning curve: experiment 1 with fewer poses to train with
    Poses(run::RunArgs),
    /// The networks of experiment 1, tested with altered body shapes
    Shapes(run::RunArgs),
    /// Experiment 1 with one camera, and without mirroring left limbs
    Ablations(run::RunArgs),
    /// All of these that the plan has data for, one after the other
    // Columns are those of one experiment's table.
    #[command(mut_arg("columns", |columns| columns.hide(true)))]
    All(run::RunArgs),
    /// Write a page of all results so far: tables, charts, largest errors
    ///
    /// Tables are shown next to the paper's, and the poses with the largest errors as images.
    Report(report::ReportArgs),
}

pub fn run(command: &ExperimentCommand, output: Output) -> anyhow::Result<()> {
    let (experiment, args) = match command {
        ExperimentCommand::One(args) => (Experiment::One, args),
        ExperimentCommand::TwoA(args) => (Experiment::TwoA, args),
        ExperimentCommand::TwoB(args) => (Experiment::TwoB, args),
        ExperimentCommand::TwoC(args) => (Experiment::TwoC, args),
        ExperimentCommand::Persons(args) => (Experiment::Persons, args),
        ExperimentCommand::Poses(args) => (Experiment::Poses, args),
        ExperimentCommand::Shapes(args) => (Experiment::Shapes, args),
        ExperimentCommand::Ablations(args) => (Experiment::Ablations, args),
        ExperimentCommand::All(args) => return run::run_all(args, output),
        ExperimentCommand::Report(args) => return report::run(args, output),
    };
    run::run(experiment, args, output)
}
