//! `ppa depth`: depth images of meshes, and the camera model by itself.

mod camera;

use std::path::{Path, PathBuf};

use anyhow::Context;
use clap::{Args, Subcommand};
use nalgebra::{Isometry3, Point3};
use ppa_depth::{
    Body, Camera, CameraSpec, DepthMode, MeshBody, PlacedBody, isometry_from_rows, render,
};
use ppa_mesh::read_ply;
use serde::{Deserialize, Serialize};

use crate::output::{Output, Seconds, Stopwatch};

#[derive(Debug, Subcommand)]
pub enum DepthCommand {
    /// Depth image of triangle meshes
    Render(RenderArgs),
    /// Camera JSON from the calibration file of a device
    Camera(camera::CameraArgs),
    /// Pixels of points given in the camera's frame
    Project(ProjectArgs),
}

#[derive(Debug, Args)]
pub struct RenderArgs {
    /// PLY meshes in one frame, mm
    #[arg(required = true)]
    meshes: Vec<PathBuf>,
    /// Camera JSON [default: an Azure Kinect, 640 x 576]
    #[arg(long)]
    camera: Option<PathBuf>,
    /// JSON with the row-major 4x4 motion from the meshes' frame to the camera's, mm [default: identity]
    #[arg(long)]
    camera_from_mesh: Option<PathBuf>,
    /// Image to write: 16-bit PNG, Z in mm, 0 invalid
    #[arg(long)]
    out: PathBuf,
}

#[derive(Debug, Args)]
pub struct ProjectArgs {
    /// CSV of points x, y, z in mm, with or without a header line
    points: PathBuf,
    /// Camera JSON [default: an Azure Kinect, 640 x 576]
    #[arg(long)]
    camera: Option<PathBuf>,
}

pub fn run(command: &DepthCommand, output: Output) -> anyhow::Result<()> {
    match command {
        DepthCommand::Render(args) => render_meshes(args, output),
        DepthCommand::Camera(args) => camera::run(args, output),
        DepthCommand::Project(args) => project(args, output),
    }
}

fn read_camera(path: Option<&PathBuf>) -> anyhow::Result<Camera> {
    let spec = match path {
        Some(path) => CameraSpec::read(path)?,
        None => CameraSpec::azure_kinect(DepthMode::NfovUnbinned),
    };
    Ok(Camera::try_from(spec)?)
}

/// A row-major 4x4 matrix, as four rows or as 16 numbers.
#[derive(Debug, Deserialize)]
#[serde(untagged)]
enum Pose {
    Rows([[f64; 4]; 4]),
    Flat([f64; 16]),
}

#[derive(Debug, Serialize)]
struct Rendered {
    width: u32,
    height: u32,
    valid_pixels: usize,
    min_mm: Option<f32>,
    max_mm: Option<f32>,
    #[serde(flatten)]
    seconds: Seconds,
}

fn render_meshes(args: &RenderArgs, output: Output) -> anyhow::Result<()> {
    let camera = read_camera(args.camera.as_ref())?;
    let camera_from_body = match &args.camera_from_mesh {
        Some(path) => {
            let rows = match super::read_json(path)? {
                Pose::Rows(rows) => rows,
                Pose::Flat(flat) => {
                    std::array::from_fn(|r| std::array::from_fn(|c| flat[4 * r + c]))
                }
            };
            isometry_from_rows(&rows).with_context(|| path.display().to_string())?
        }
        None => Isometry3::identity(),
    };
    let mut bodies = Vec::new();
    for path in &args.meshes {
        let mesh = read_ply(path)?;
        let body = MeshBody::new(&mesh.cloud.points, &mesh.triangles)
            .with_context(|| path.display().to_string())?;
        bodies.push(Body::Mesh(body));
    }
    let placed: Vec<_> = bodies
        .iter()
        .map(|body| PlacedBody {
            body,
            camera_from_body,
        })
        .collect();
    let watch = Stopwatch::start();
    let image = render(&camera, &placed);
    let seconds = watch.read();
    image.require_visible()?;
    image.write_png(&args.out)?;
    let rendered = Rendered {
        width: image.width,
        height: image.height,
        valid_pixels: image.valid_pixels(),
        min_mm: image.min_mm(),
        max_mm: image.max_mm(),
        seconds,
    };
    output.print(&rendered, |r| {
        format!(
            "{}: {} of {} x {} pixels see a surface",
            args.out.display(),
            r.valid_pixels,
            r.width,
            r.height
        )
    })
}

/// Reads rows of x, y, z; a first row that is not numbers is a header.
fn read_points(path: &Path) -> anyhow::Result<Vec<[f64; 3]>> {
    let mut reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .trim(csv::Trim::All)
        .from_path(path)
        .with_context(|| format!("cannot read {}", path.display()))?;
    let mut points = Vec::new();
    for (row, record) in reader.records().enumerate() {
        let record = record.with_context(|| format!("cannot read {}", path.display()))?;
        match record.deserialize(None) {
            Ok(point) => points.push(point),
            Err(_) if row == 0 => {}
            Err(_) => anyhow::bail!(
                "row {} of {} is not three numbers x, y, z",
                row + 1,
                path.display()
            ),
        }
    }
    Ok(points)
}

#[derive(Debug, Serialize)]
struct Projected {
    pixels: Vec<Option<[f64; 2]>>,
}

fn project(args: &ProjectArgs, output: Output) -> anyhow::Result<()> {
    let camera = read_camera(args.camera.as_ref())?;
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
            Some([u, v]) => format!("{u:.6} {v:.6}"),
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
