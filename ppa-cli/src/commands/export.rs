//! `ppa export`: a dataset for other programs, archives and search engines.

mod bagit;
mod metadata;
mod table;
mod webdataset;

use clap::Subcommand;

use crate::output::Output;

#[derive(Debug, Subcommand)]
pub enum ExportCommand {
    /// One row per file with pose, label, split and hash (CSV, Parquet)
    Table(table::TableArgs),
    /// Metadata: Croissant for search engines, RO-Crate for archives
    Metadata(metadata::MetadataArgs),
    /// BagIt, a copy with the hash of every file, for archives
    Bagit(bagit::BagitArgs),
    /// Tar archives for training programs that stream
    Webdataset(webdataset::WebdatasetArgs),
}

pub fn run(command: &ExportCommand, output: Output) -> anyhow::Result<()> {
    match command {
        ExportCommand::Table(args) => table::run(args, output),
        ExportCommand::Metadata(args) => metadata::run(args, output),
        ExportCommand::Bagit(args) => bagit::run(args, output),
        ExportCommand::Webdataset(args) => webdataset::run(args, output),
    }
}
