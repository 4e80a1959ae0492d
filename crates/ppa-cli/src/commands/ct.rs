//! `ppa ct`: look at, convert or make a CT.

use std::path::PathBuf;

use anyhow::Context;
use clap::{Args, Subcommand};
use ppa_ct::phantom::{LowerLeg, TableTop};
use ppa_ct::{Info, read, write_nifti};

use crate::output::{Output, working};
use crate::scan_args::ScanArgs;

#[derive(Debug, Subcommand)]
pub enum CtCommand {
    /// Size, spacing, orientation, HU range and warnings of a CT
    Info(InfoArgs),
    /// Write a CT as NIfTI
    Convert(ConvertArgs),
    /// Make the built-in phantom P01: a right lower leg and foot
    Phantom(PhantomArgs),
}

#[derive(Debug, Args)]
pub struct InfoArgs {
    #[command(flatten)]
    scan: ScanArgs,
}

#[derive(Debug, Args)]
pub struct ConvertArgs {
    #[command(flatten)]
    input: ScanArgs,
    /// File to write: .nii or .nii.gz
    output: PathBuf,
}

#[derive(Debug, Args)]
pub struct PhantomArgs {
    /// File to write: .nii or .nii.gz
    #[arg(long)]
    out: PathBuf,
    /// Side of the cubic voxels in mm
    #[arg(long, default_value_t = 0.8)]
    spacing_mm: f64,
    /// Let the leg lie on a table top
    #[arg(long)]
    table: bool,
}

pub fn run(command: &CtCommand, output: Output) -> anyhow::Result<()> {
    match command {
        CtCommand::Info(args) => {
            let scan = args.scan.read()?;
            output.print(&Info::of(&scan), describe)
        }
        CtCommand::Convert(args) => {
            let scan = args.input.read()?;
            write_nifti(&args.output, &scan.volume)?;
            output.print(&Info::of(&read(&args.output)?), describe)
        }
        CtCommand::Phantom(args) => {
            let _working = working("voxelising the phantom");
            let table = if args.table {
                TableTop::Present
            } else {
                TableTop::Absent
            };
            let volume = LowerLeg::p01()
                .voxelise(args.spacing_mm, table)
                .context("cannot voxelise the phantom")?;
            write_nifti(&args.out, &volume)?;
            output.print(&Info::of_volume(&volume), describe)
        }
    }
}

fn describe(info: &Info) -> String {
    let [nx, ny, nz] = info.size;
    let [sx, sy, sz] = info.spacing_mm;
    let [ox, oy, oz] = info.origin_mm;
    let mut lines = vec![
        format!("size       {nx} x {ny} x {nz} voxels"),
        format!("spacing    {sx:.4} x {sy:.4} x {sz:.4} mm"),
        format!("origin     {ox:.3} {oy:.3} {oz:.3} mm (LPS)"),
    ];
    for (row, name) in info.direction.iter().zip(["direction", "", ""]) {
        lines.push(format!(
            "{name:<10} {:>9.6} {:>9.6} {:>9.6}",
            row[0], row[1], row[2]
        ));
    }
    lines.push(format!("HU         {} to {}", info.hu_min, info.hu_max));
    let modality = info.modality.as_deref().unwrap_or("not stated");
    lines.push(format!("modality   {modality}"));
    for series in &info.series {
        let number = series
            .number
            .map_or("without number".to_owned(), |n| n.to_string());
        let left = if series.read { "" } else { ", not read" };
        lines.push(format!(
            "series     {number}: {} slices{left}",
            series.slices
        ));
    }
    for warning in &info.warnings {
        lines.push(format!("warning    {}", warning.text));
    }
    lines.join("\n")
}
