//! `ppa dataset`: datasets in the published layouts, by this program or the authors.

mod check;
mod convert;
mod split;

use clap::Subcommand;

use crate::output::Output;

#[derive(Debug, Subcommand)]
pub enum DatasetCommand {
    /// Check hashes, images, regions of interest, labels and splits
    Check(check::CheckArgs),
    /// Convert to the other published layout: synthetic to specimen, or back
    Convert(convert::ConvertArgs),
    /// Split the persons at random into training, validation and test
    Split(split::SplitArgs),
}

pub fn run(command: &DatasetCommand, output: Output) -> anyhow::Result<()> {
    match command {
        DatasetCommand::Check(args) => check::run(args, output),
        DatasetCommand::Convert(args) => convert::run(args, output),
        DatasetCommand::Split(args) => split::run(args, output),
    }
}
