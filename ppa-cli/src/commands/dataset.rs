//! `ppa dataset`: datasets in the published layouts, ours or the authors'.

mod check;
mod convert;
mod split;

use clap::Subcommand;

use crate::output::Output;

#[derive(Debug, Subcommand)]
pub enum DatasetCommand {
    /// Look for damaged images, regions outside of them, and persons on both sides of a split
    Check(check::CheckArgs),
    /// Write it in the other published layout: synthetic to specimen, or back
    Convert(convert::ConvertArgs),
    /// Draw which persons are for training and which for testing
    Split(split::SplitArgs),
}

pub fn run(command: &DatasetCommand, output: Output) -> anyhow::Result<()> {
    match command {
        DatasetCommand::Check(args) => check::run(args, output),
        DatasetCommand::Convert(args) => convert::run(args, output),
        DatasetCommand::Split(args) => split::run(args, output),
    }
}
