//! The program `ppa`: paired depth images and radiographs from CT scans.
//!
//! Parses arguments, calls the libraries and prints. Results go to stdout, everything else to stderr.

mod allocator;
mod cluster_report;
mod commands;
mod findings;
mod help;
mod interrupt;
mod interrupted;
mod number_lists;
mod output;
mod output_files;
mod progress;
mod scan_args;
mod shard;
mod side_name;
mod stderr;

use std::ffi::OsString;
use std::io::Write;
use std::path::Path;

use anyhow::Context;
use clap::{ColorChoice, FromArgMatches, Parser, Subcommand};

use crate::output::Output;
use crate::stderr::GlobalOptions;

/// Paired Time-of-Flight depth images and radiographs of posed limbs from CT scans.
///
/// Start with `ppa demo`. With a CT of your own: `ppa ct info`, `ppa prepare`, then
/// `ppa generate` with a plan.
#[derive(Debug, Parser)]
#[command(name = "ppa", version, propagate_version = true)]
struct Cli {
    #[command(subcommand)]
    command: Command,
    /// Print one JSON object instead of text, and JSON lines on stderr
    ///
    /// Each line on stderr is then one object: {"warning": "…"}, {"note": "…"}, progress with the keys done and units, and, if the command
    /// fails, {"error": "…", "causes": ["…"], "exit_code": 1}. The exit code is 2 for an invalid command line, otherwise 1.
    #[arg(long, global = true)]
    json: bool,
    /// When to colour messages, help and progress
    ///
    /// `auto` colours what goes to a terminal, unless NO_COLOR, CLICOLOR=0 or TERM=dumb forbid it; CLICOLOR_FORCE=1 asks for
    /// colours elsewhere as well.
    #[arg(long, global = true, value_name = "WHEN", value_enum, default_value_t = ColorChoice::Auto)]
    color: ColorChoice,
    /// Worker threads [default: one per core]
    #[arg(long, global = true, value_name = "N")]
    threads: Option<std::num::NonZeroUsize>,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Make a small dataset and a contact sheet of the built-in phantom
    Demo(commands::demo::DemoArgs),
    /// Inspect and correct a limb in the browser, and try poses
    #[cfg(feature = "studio")]
    Studio(commands::studio::StudioArgs),
    /// Inspect, convert or make a CT
    #[command(subcommand)]
    Ct(commands::ct::CtCommand),
    /// Find skin, axis and plane of a limb, and write them as a case
    Prepare(Box<commands::prepare::PrepareArgs>),
    /// Check a case
    #[command(subcommand)]
    Case(commands::case::CaseCommand),
    /// Surfaces of a CT
    #[command(subcommand)]
    Mesh(commands::mesh::MeshCommand),
    /// The x-ray room, and the limb on its table
    #[command(subcommand)]
    Scene(commands::scene::SceneCommand),
    /// Depth images and the camera model
    #[command(subcommand)]
    Depth(commands::depth::DepthCommand),
    /// Radiographs, spectra and materials
    #[command(subcommand)]
    Xray(commands::xray::XrayCommand),
    /// Estimate time and disk space of a plan, and check that it can run
    Plan(commands::plan::PlanArgs),
    /// Make or resume the dataset of a plan
    Generate(commands::generate::GenerateArgs),
    /// Run a plan on a cluster
    #[command(subcommand)]
    Submit(Box<commands::submit::SubmitCommand>),
    /// Show the progress of a dataset, or of the jobs that make it
    Status(commands::status::StatusArgs),
    /// Cancel the jobs of a plan on a cluster
    Cancel(commands::cancel::CancelArgs),
    /// Join the shards of a plan
    Merge(commands::merge::MergeArgs),
    /// Check all files of a dataset and recompute a sample of its poses
    Verify(commands::verify::VerifyArgs),
    /// Check, split or convert a dataset, ours or the authors'
    #[command(subcommand)]
    Dataset(commands::dataset::DatasetCommand),
    /// Show a dataset on one page of HTML, to inspect before training
    Qa(commands::qa::QaArgs),
    /// Tables, metadata and archives of a dataset for other programs
    #[command(subcommand)]
    Export(commands::export::ExportCommand),
    /// Labels of pose quality: by readers or computed from bones
    #[command(subcommand)]
    Label(commands::label::LabelCommand),
    /// Export weights, and compare the network with reference values
    #[command(subcommand)]
    Learn(commands::learn::LearnCommand),
    /// Train a network on depth images and labels, or resume it
    Train(commands::train::TrainArgs),
    /// Metrics, predictions and figures of a trained network
    Eval(commands::eval::EvalArgs),
    /// Calibrate prediction intervals of networks with further persons
    Calibrate(commands::calibrate::CalibrateArgs),
    /// Predict pose quality from pairs of depth images as they arrive
    Predict(commands::predict::PredictArgs),
    /// Run the paper's experiments and write their tables
    #[command(subcommand)]
    Experiment(commands::experiment::ExperimentCommand),
    /// Metrics of predictions against labels
    Metrics(commands::metrics::MetricsArgs),
    /// Statistical tests
    #[command(subcommand)]
    Stats(commands::stats::StatsCommand),
    /// Print the completions of commands and options for a shell
    Completions(commands::completions::CompletionsArgs),
    /// Write the manual pages of all commands
    Man(commands::man::ManArgs),
}

fn run(cli: Cli, program: &Path) -> anyhow::Result<()> {
    // Started here: if threads cannot be started at first use, the program would abort.
    rayon::ThreadPoolBuilder::new()
        .num_threads(cli.threads.map_or(0, std::num::NonZeroUsize::get))
        .build_global()
        .context("cannot start threads; `--threads 1` needs the least memory")?;
    let output = Output { json: cli.json };
    match cli.command {
        Command::Demo(args) => commands::demo::run(&args, output),
        #[cfg(feature = "studio")]
        Command::Studio(args) => commands::studio::run(&args, output),
        Command::Ct(command) => commands::ct::run(&command, output),
        Command::Prepare(args) => commands::prepare::run(&args, output),
        Command::Case(command) => commands::case::run(&command, output),
        Command::Mesh(command) => commands::mesh::run(&command, output),
        Command::Scene(command) => commands::scene::run(&command, output),
        Command::Depth(command) => commands::depth::run(&command, output),
        Command::Xray(command) => commands::xray::run(&command, output),
        Command::Plan(args) => commands::plan::run(&args, output),
        Command::Generate(args) => commands::generate::run(&args, output),
        Command::Submit(command) => commands::submit::run(&command, program, output),
        Command::Status(args) => commands::status::run(&args, output),
        Command::Cancel(args) => commands::cancel::run(&args, output),
        Command::Merge(args) => commands::merge::run(&args, output),
        Command::Verify(args) => commands::verify::run(&args, output),
        Command::Dataset(command) => commands::dataset::run(&command, output),
        Command::Qa(args) => commands::qa::run(&args, output),
        Command::Export(command) => commands::export::run(&command, output),
        Command::Label(command) => commands::label::run(&command, output),
        Command::Learn(command) => commands::learn::run(&command, output),
        Command::Train(args) => commands::train::run(&args, output),
        Command::Eval(args) => commands::eval::run(&args, output),
        Command::Calibrate(args) => commands::calibrate::run(&args, output),
        Command::Predict(args) => commands::predict::run(&args, output),
        Command::Experiment(command) => commands::experiment::run(&command, output),
        Command::Metrics(args) => commands::metrics::run(&args, output),
        Command::Stats(command) => commands::stats::run(&command, output),
        Command::Completions(args) => commands::completions::run(&args, output),
        Command::Man(args) => commands::man::run(&args, output),
    }
}

/// Runs a command line, which starts with the name of the program, and returns the exit code.
///
/// To be called once in a process: the first command line sets up the threads and the output. `program` is what the jobs
/// of `ppa submit` run.
pub fn run_program(arguments: &[OsString], program: &Path) -> u8 {
    let options = GlobalOptions::of(arguments);
    let mut command = help::command().color(options.color);
    let parsed = command.try_get_matches_from_mut(arguments);
    let cli = parsed
        .and_then(|matches| Cli::from_arg_matches(&matches))
        .map_err(|error| error.format(&mut command));
    let exit_code = match cli {
        Ok(cli) => {
            stderr::set_up(cli.json, cli.color);
            run(cli, program).map_or_else(|error| stderr::failure(&error), |()| 0)
        }
        Err(error) => {
            stderr::set_up(options.json, options.color);
            stderr::usage(&error)
        }
    };
    // The reader may already have closed stdout.
    let _ = std::io::stdout().flush();
    exit_code
}
