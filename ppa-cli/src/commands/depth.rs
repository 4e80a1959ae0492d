//! `ppa depth`: depth images of meshes, and the camera model by itself.

mod camera;
mod coverage;
mod coverage_table;
mod fit_noise;
mod project;
mod render;
mod render_case;
mod render_meshes;

use std::path::PathBuf;

use anyhow::Context;
use clap::Subcommand;
use ppa_depth::{Camera, CameraSpec, DepthMode};

use crate::output::Output;

#[derive(Debug, Subcommand)]
pub enum DepthCommand {
    /// Depth image of meshes or of a room, or of a case's limb on the table as both cameras see it
    Render(Box<render::RenderArgs>),
    /// Noise of a camera from a recording of a scene that stands still
    FitNoise(fit_noise::FitNoiseArgs),
    /// Camera JSON from the calibration file of a device
    Camera(camera::CameraArgs),
    /// Where a camera would see most of a joint
    Coverage(coverage::CoverageArgs),
    /// Pixels of points given in the camera's frame
    Project(project::ProjectArgs),
}

pub fn run(command: &DepthCommand, output: Output) -> anyhow::Result<()> {
    match command {
        DepthCommand::Render(args) => match args.case()? {
            Some(case) => render_case::run(case, args, output),
            None => render_meshes::run(args, output),
        },
        DepthCommand::FitNoise(args) => fit_noise::run(args, output),
        DepthCommand::Camera(args) => camera::run(args, output),
        DepthCommand::Coverage(args) => coverage::run(args, output),
        DepthCommand::Project(args) => project::run(args, output),
    }
}

fn read_camera(path: Option<&PathBuf>) -> anyhow::Result<Camera> {
    let spec = match path {
        Some(path) => CameraSpec::read(path).context(
            "--camera takes a camera JSON; `ppa depth camera` makes one of a calibration file",
        )?,
        None => CameraSpec::azure_kinect(DepthMode::NfovUnbinned),
    };
    let camera = Camera::try_from(spec);
    Ok(match path {
        Some(path) => camera.with_context(|| path.display().to_string())?,
        None => camera?,
    })
}
