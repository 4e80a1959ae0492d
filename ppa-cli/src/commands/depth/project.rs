//! `ppa depth project`: projects points with the camera model.

use std::path::{Path, PathBuf};

use anyhow::Context;
use clap::Args;
use nalgebra::Point3;
use ppa_core::text::number;
use serde::Serialize;

use crate::output::Output;

#[derive(Debug, Args)]
pub struct ProjectArgs {
    /// CSV of points x, y, z in mm, with or without a header line
    points: PathBuf,
    /// Camera JSON [default: an Azure Kinect, 640 x 576]
    #[arg(long)]
    camera: Option<PathBuf>,
}

/// Reads rows of x, y, z; a first row of three words, none of them a number, is a header.
fn read_points(path: &Path) -> anyhow::Result<Vec<[f64; 3]>> {
    let file = ppa_core::regular_file::open(path)
        .with_context(|| format!("cannot read {}", path.display()))?;
    let mut reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .trim(csv::Trim::All)
        .from_reader(file);
    let mut points = Vec::new();
    for (row, record) in reader.records().enumerate() {
        let record = record.with_context(|| format!("cannot read {}", path.display()))?;
        let fields: Vec<Option<f64>> = record.iter().map(|field| field.parse().ok()).collect();
        match fields[..] {
            [Some(x), Some(y), Some(z)] if [x, y, z].iter().all(|v| v.is_finite()) => {
                points.push([x, y, z]);
            }
            [None, None, None] if row == 0 => {}
            _ => anyhow::bail!(
                "row {} of {} is not three numbers x, y, z",
                row + 1,
                path.display()
            ),
        }
    }
    anyhow::ensure!(!points.is_empty(), "{} contains no points", path.display());
    Ok(points)
}

#[derive(Debug, Serialize)]
struct Projected {
    pixels: Vec<Option<[f64; 2]>>,
}

pub fn run(args: &ProjectArgs, output: Output) -> anyhow::Result<()> {
    let camera = super::read_camera(args.camera.as_ref())?;
    let points = read_points(&args.points)?;
    let pixels = points
        .iter()
        .map(|point| {
            camera
                .project(&Point3::from(*point))
                .map(|pixel| [pixel.x, pixel.y])
        })
        .collect();
    output.print(&Projected { pixels }, |projected| {
        let line = |pixel: &Option<[f64; 2]>| match pixel {
            Some([u, v]) => format!("{:.6} {:.6}", number(*u), number(*v)),
            None => "not seen".to_owned(),
        };
        projected
            .pixels
            .iter()
            .map(line)
            .collect::<Vec<_>>()
            .join("\n")
    })
}
