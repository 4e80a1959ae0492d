//! `ppa label`: the quality of poses.

mod agree;
mod export;
mod import;

use clap::Subcommand;

use crate::output::Output;

#[derive(Debug, Subcommand)]
pub enum LabelCommand {
    /// How far readers agree with each other, and with themselves
    Agree(agree::AgreeArgs),
    /// A page on which readers grade radiographs, blinded and shuffled
    Export(export::ExportArgs),
    /// Labels from the grades of readers
    Import(import::ImportArgs),
}

pub fn run(command: &LabelCommand, output: Output) -> anyhow::Result<()> {
    match command {
        LabelCommand::Agree(args) => agree::run(args, output),
        LabelCommand::Export(args) => export::run(args, output),
        LabelCommand::Import(args) => import::run(args, output),
    }
}
