//! `ppa ct convert`: a CT from any format that is read to any that is written.

use std::path::PathBuf;

use clap::Args;
use ppa_ct::{Info, read, write};

use crate::output::{Output, working};
use crate::scan_args::ScanArgs;

#[derive(Debug, Args)]
pub struct ConvertArgs {
    #[command(flatten)]
    input: ScanArgs,
    /// What to write: .nii, .nii.gz, .nrrd, .mha, .mhd, or a new folder for DICOM slices
    output: PathBuf,
}

pub fn run(args: &ConvertArgs, output: Output) -> anyhow::Result<()> {
    let _working = working("converting");
    write(&args.output, &args.input.read()?.volume)?;
    // Told from the file, so that what is printed is what others will read.
    output.print(&Info::of(&read(&args.output)?), super::describe)
}
