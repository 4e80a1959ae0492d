//! `ppa`: CT scans in, paired depth images and radiographs out.
//!
//! Parses, calls the libraries, prints. Results go to stdout, everything else to stderr.

mod commands;
mod interrupt;
mod number_lists;
mod output;
mod output_files;
mod progress;
mod scan_args;
mod shard;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

use crate::interrupt::Interrupted;
use crate::output::Output;

/// Paired Time-of-Flight depth images and radiographs of posed limbs, made from CT scans.
///
/// Start with `ppa demo`. With a CT of your own: `ppa ct info`, `ppa prepare`, then
/// `ppa generate` with a plan.
#[derive(Debug, Parser)]
#[command(name = "ppa", version, propagate_version = true)]
struct Cli {
    #[command(subcommand)]
    command: Command,
    /// Print one JSON object instead of text
    #[arg(long, global = true)]
    json: bool,
    /// Worker threads [default: one per core]
    #[arg(long, global = true, value_name = "N")]
    threads: Option<std::num::NonZeroUsize>,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// From the built-in phantom to a small dataset and a contact sheet, in minutes
    Demo(commands::demo::DemoArgs),
    /// Look at, convert or make a CT
    #[command(subcommand)]
    Ct(commands::ct::CtCommand),
    /// Find skin, axis and plane of a limb and write them down as a case
    Prepare(Box<commands::prepare::PrepareArgs>),
    /// Surfaces of a CT
    #[command(subcommand)]
    Mesh(commands::mesh::MeshCommand),
    /// The table, and the limb on it
    #[command(subcommand)]
    Scene(commands::scene::SceneCommand),
    /// Depth images and the camera model
    #[command(subcommand)]
    Depth(commands::depth::DepthCommand),
    /// Radiographs, spectra and materials
    #[command(subcommand)]
    Xray(commands::xray::XrayCommand),
    /// Tell what the dataset of a plan will take, and whether it can be made
    Plan(commands::plan::PlanArgs),
    /// Make, or go on with, the dataset of a plan
    Generate(commands::generate::GenerateArgs),
    /// Tell how far a dataset has come
    Status(commands::status::StatusArgs),
    /// Join the shards of a plan
    Merge(commands::merge::MergeArgs),
    /// Check all files of a dataset, and make a sample of it again
    Verify(commands::verify::VerifyArgs),
    /// Check, split or convert a dataset, ours or the authors'
    #[command(subcommand)]
    Dataset(commands::dataset::DatasetCommand),
    /// A dataset on one page of HTML, to look through before anything is trained on it
    Qa(commands::qa::QaArgs),
    /// Tables, metadata and archives of a dataset for other programs
    #[command(subcommand)]
    Export(commands::export::ExportCommand),
    /// The quality of poses, as readers grade it
    #[command(subcommand)]
    Label(commands::label::LabelCommand),
    /// The network's weights, and the network beside reference values
    #[command(subcommand)]
    Learn(commands::learn::LearnCommand),
    /// Train a network on depth images and labels, or go on with it
    Train(commands::train::TrainArgs),
    /// Metrics, predictions and figures of a trained network
    Eval(commands::eval::EvalArgs),
    /// Judge depth images while cameras deliver them, pair by pair
    Predict(commands::predict::PredictArgs),
    /// The paper's experiments: trainings and tables from one plan
    Experiment(commands::experiment::ExperimentArgs),
    /// Metrics of predictions against labels
    Metrics(commands::metrics::MetricsArgs),
    /// Statistical tests
    #[command(subcommand)]
    Stats(commands::stats::StatsCommand),
}

fn run(cli: Cli) -> anyhow::Result<()> {
    if let Some(threads) = cli.threads {
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads.get())
            .build_global()?;
    }
    let output = Output { json: cli.json };
    match cli.command {
        Command::Demo(args) => commands::demo::run(&args, output),
        Command::Ct(command) => commands::ct::run(&command, output),
        Command::Prepare(args) => commands::prepare::run(&args, output),
        Command::Mesh(command) => commands::mesh::run(&command, output),
        Command::Scene(command) => commands::scene::run(&command, output),
        Command::Depth(command) => commands::depth::run(&command, output),
        Command::Xray(command) => commands::xray::run(&command, output),
        Command::Plan(args) => commands::plan::run(&args, output),
        Command::Generate(args) => commands::generate::run(&args, output),
        Command::Status(args) => commands::status::run(&args, output),
        Command::Merge(args) => commands::merge::run(&args, output),
        Command::Verify(args) => commands::verify::run(&args, output),
        Command::Dataset(command) => commands::dataset::run(&command, output),
        Command::Qa(args) => commands::qa::run(&args, output),
        Command::Export(command) => commands::export::run(&command, output),
        Command::Label(command) => commands::label::run(&command, output),
        Command::Learn(command) => commands::learn::run(&command, output),
        Command::Train(args) => commands::train::run(&args, output),
        Command::Eval(args) => commands::eval::run(&args, output),
        Command::Predict(args) => commands::predict::run(&args, output),
        Command::Experiment(args) => commands::experiment::run(&args, output),
        Command::Metrics(args) => commands::metrics::run(&args, output),
        Command::Stats(command) => commands::stats::run(&command, output),
    }
}

fn main() -> ExitCode {
    match run(Cli::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("ppa: {error:#}");
            match error.downcast_ref::<Interrupted>() {
                Some(stopped) => stopped.exit_code().into(),
                None => ExitCode::FAILURE,
            }
        }
    }
}
