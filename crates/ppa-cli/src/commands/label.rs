//! `ppa label`: the quality of poses.

mod agree;

use clap::Subcommand;

use crate::output::Output;

#[derive(Debug, Subcommand)]
pub enum LabelCommand {
    /// How far readers agree with each other, and with themselves
    Agree(agree::AgreeArgs),
}

pub fn run(command: &LabelCommand, output: Output) -> anyhow::Result<()> {
    match command {
        LabelCommand::Agree(args) => agree::run(args, output),
    }
}
