//! `ppa label`: labels of pose quality.

mod agree;
mod auto;
mod export;
mod import;

use clap::Subcommand;

use crate::output::Output;

#[derive(Debug, Subcommand)]
pub enum LabelCommand {
    /// Agreement of readers with each other, and with themselves
    Agree(agree::AgreeArgs),
    /// Labels from the bones: openness of the joint space along the beam
    Auto(auto::AutoArgs),
    /// A page on which readers grade radiographs, blinded and shuffled
    Export(export::ExportArgs),
    /// Labels from the grades of readers
    Import(import::ImportArgs),
}

pub fn run(command: &LabelCommand, output: Output) -> anyhow::Result<()> {
    match command {
        LabelCommand::Agree(args) => agree::run(args, output),
        LabelCommand::Auto(args) => auto::run(args, output),
        LabelCommand::Export(args) => export::run(args, output),
        LabelCommand::Import(args) => import::run(args, output),
    }
}
