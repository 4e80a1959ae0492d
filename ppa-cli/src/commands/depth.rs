//! `ppa depth`: depth images of meshes, and the camera model.

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
    /// Render depth images of meshes, of a room, or of the limb of a case
    Render(Box<render::RenderArgs>),
    /// Fit the noise of a camera to a recording of a static scene
    FitNoise(fit_noise::FitNoiseArgs),
    /// Camera JSON from the calibration file of a device
    Camera(camera::CameraArgs),
    /// Find camera positions that see most of a joint
    Coverage(coverage::CoverageArgs),
    /// Project points in the camera's frame to pixels
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
            "--camera expects a camera JSON file; `ppa depth camera` makes one from a calibration file",
        )?,
        None => CameraSpec::azure_kinect(DepthMode::NfovUnbinned),
    };
    let camera = Camera::try_from(spec);
    Ok(match path {
        Some(path) => camera.with_context(|| path.display().to_string())?,
        None => camera?,
    })
}
