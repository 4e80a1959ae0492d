//! A command line of `ppa xray` whose histories can be divided.

use anyhow::{anyhow, ensure};
use clap::Parser;
use ppa_cluster::{HistoryCommand, HistoryCost};

use crate::commands::xray::{Divisible, McgpuArgs, SimulateArgs, XrayCommand};
use crate::stderr::in_one_line;

/// A command of `ppa xray` that simulates histories.
pub enum DivisibleCommand {
    Simulate(Box<SimulateArgs>),
    Mcgpu(McgpuArgs),
}

/// The command line after `ppa`.
#[derive(Debug, Parser)]
#[command(name = "xray", disable_help_subcommand = true)]
struct CommandLine {
    #[command(subcommand)]
    command: XrayCommand,
}

impl DivisibleCommand {
    /// Parses the words of a command line after `ppa`.
    pub fn parse(words: &[String]) -> anyhow::Result<Self> {
        ensure!(
            !words.iter().any(|word| word == "--"),
            "the command after -- contains another --"
        );
        let other = || {
            let words = words.join(" ");
            anyhow!("the command after -- is \"{words}\", expected xray simulate or xray mcgpu")
        };
        if words.first().is_none_or(|first| first != "xray") {
            return Err(other());
        }
        let parsed = CommandLine::try_parse_from(words)
            .map_err(|error| anyhow!("in the command after --: {}", in_one_line(&error)))?;
        match parsed.command {
            XrayCommand::Simulate(args) => Ok(Self::Simulate(args)),
            XrayCommand::Mcgpu(args) => Ok(Self::Mcgpu(args)),
            _ => Err(other()),
        }
    }

    /// Kind of the command.
    pub fn kind(&self) -> HistoryCommand {
        match self {
            Self::Simulate(_) => HistoryCommand::Simulate,
            Self::Mcgpu(_) => HistoryCommand::Mcgpu,
        }
    }

    /// Its options for outputs: those with a value, and those without.
    pub fn output_options(&self) -> (&'static [&'static str], &'static [&'static str]) {
        match self {
            Self::Simulate(_) => (
                &[
                    "--out",
                    "--exr",
                    "--dicom",
                    "--dose-map",
                    "--protocol",
                    "--target-exposure-index",
                ],
                &["--replace", "--for-processing", "--autoscale"],
            ),
            Self::Mcgpu(_) => (&["--out"], &["--replace"]),
        }
    }

    /// Its histories.
    pub fn divisible(&self) -> anyhow::Result<Divisible> {
        match self {
            Self::Simulate(args) => args.divisible(),
            Self::Mcgpu(args) => args.divisible(),
        }
    }

    /// Refuses outputs that could not be written at the end.
    pub fn check_outputs(&self) -> anyhow::Result<()> {
        match self {
            Self::Simulate(args) => args.check_outputs(),
            Self::Mcgpu(args) => args.check_outputs(),
        }
    }

    /// Processor time per history, measured on some.
    pub fn cost(&self) -> anyhow::Result<HistoryCost> {
        match self {
            Self::Simulate(args) => args.cost(),
            Self::Mcgpu(args) => args.cost(),
        }
    }
}
