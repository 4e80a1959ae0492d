//! `ppa ct`: inspect, convert or make a CT.

mod convert;
mod info;
mod phantom;

use clap::Subcommand;
use ppa_core::text::{count, number};
use ppa_ct::Info;

use crate::output::Output;

#[derive(Debug, Subcommand)]
pub enum CtCommand {
    /// Report geometry, values and anomalies of a CT, and their effects
    Info(info::InfoArgs),
    /// Write a CT in another format: NIfTI, NRRD, MetaImage or DICOM
    Convert(convert::ConvertArgs),
    /// Make the CT of a phantom, a lower leg or a knee
    Phantom(phantom::PhantomArgs),
}

pub fn run(command: &CtCommand, output: Output) -> anyhow::Result<()> {
    match command {
        CtCommand::Info(args) => info::run(args, output),
        CtCommand::Convert(args) => convert::run(args, output),
        CtCommand::Phantom(args) => phantom::run(args, output),
    }
}

fn describe(info: &Info) -> String {
    let [nx, ny, nz] = info.size;
    let [sx, sy, sz] = info.spacing_mm;
    let [ox, oy, oz] = info.origin_mm;
    let mut lines = vec![
        format!("size       {nx} x {ny} x {nz} voxels"),
        format!("spacing    {sx:.4} x {sy:.4} x {sz:.4} mm"),
        format!(
            "origin     {:.3} {:.3} {:.3} mm (LPS)",
            number(ox),
            number(oy),
            number(oz)
        ),
    ];
    for (row, name) in info.direction.iter().zip(["direction", "", ""]) {
        lines.push(format!(
            "{name:<10} {:>9.6} {:>9.6} {:>9.6}",
            number(row[0]),
            number(row[1]),
            number(row[2])
        ));
    }
    lines.push(format!("HU         {} to {}", info.hu_min, info.hu_max));
    let modality = info.modality.as_deref().unwrap_or("not stated");
    lines.push(format!("modality   {modality}"));
    for series in &info.series {
        let name = series
            .number
            .map_or("without a number".to_owned(), |n| n.to_string());
        let left = match &series.refused {
            Some(reason) => format!(", refused: {reason}"),
            None if series.read => String::new(),
            None => ", not read".to_owned(),
        };
        lines.push(format!(
            "series     {name}: {}{left}",
            count(series.slices, "slice")
        ));
    }
    for warning in &info.warnings {
        lines.push(format!("warning    {}", warning.text));
    }
    lines.join("\n")
}
