//! Options of `ppa depth render`, and the files that it writes for an image.

use std::path::{Path, PathBuf};

use anyhow::bail;
use clap::{Args, ValueEnum};
use ppa_dataset::BodyShape;
use ppa_dataset::layout::View;
use ppa_depth::{Camera, DepthImage, SensorSpec};

use crate::commands::mesh::body_shape_named;
use crate::commands::scene::WhichRoom;
use crate::output_files::ReplaceArgs;

#[derive(Debug, Args)]
pub(super) struct OfCase {
    /// Medial rotation of a case's limb, degrees [default: 0]
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    pub(super) angle: Option<f64>,
    /// One of the two cameras of a case's room [default: both]
    #[arg(long, value_enum)]
    view: Option<ViewName>,
    /// Body shape of a case: orig, big, small, bumps_a or bumps_b, as in a dataset of --plan; bumps are those of the case's person there, else of person 0 [default: orig]
    #[arg(long, value_parser = body_shape_named)]
    pub(super) shape: Option<BodyShape>,
    #[command(flatten)]
    pub(super) room: WhichRoom,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum ViewName {
    Left,
    Right,
}

impl OfCase {
    /// The first given option that applies only to a case.
    fn given(&self) -> Option<&'static str> {
        let given = [
            ("--angle", self.angle.is_some()),
            ("--view", self.view.is_some()),
            ("--shape", self.shape.is_some()),
            ("--plan or --room", self.room.is_given()),
        ];
        given
            .into_iter()
            .find(|(_, given)| *given)
            .map(|(name, _)| name)
    }

    /// The chosen camera.
    pub fn view(&self) -> Option<View> {
        self.view.map(|view| match view {
            ViewName::Left => View::Left,
            ViewName::Right => View::Right,
        })
    }
}

#[derive(Debug, Args)]
pub struct RenderArgs {
    /// Meshes or rooms in one frame, mm: .ply, .obj or .stl; or one case of `ppa prepare`, .toml, with --angle
    #[arg(required = true, value_name = "MESH|CASE")]
    pub(super) meshes: Vec<PathBuf>,
    #[command(flatten)]
    pub(super) of_case: OfCase,
    /// Camera JSON [default: an Azure Kinect, 640 x 576]
    #[arg(long)]
    pub(super) camera: Option<PathBuf>,
    /// JSON with the row-major 4x4 motion from the meshes' frame to the camera's, mm, or a file written by --frames of `ppa scene
    /// place` or `ppa scene room`, with --motion [default: identity]
    #[arg(long)]
    pub(super) camera_from_mesh: Option<PathBuf>,
    /// Which motion of that file: left_from_room for a room or a placed skin, left_from_ct for a skin in the scan
    #[arg(long, value_name = "NAME", requires = "camera_from_mesh")]
    pub(super) motion: Option<String>,
    /// Image to write: 16-bit PNG, Z in mm, 0 invalid; several frames become name_0000.png, name_0001.png …; a case gives
    /// name_left.png and name_right.png unless --view chooses one
    #[arg(long)]
    pub(super) out: PathBuf,
    /// Also write the depths as floats, OpenEXR
    #[arg(long)]
    pub(super) exr: Option<PathBuf>,
    /// Also write a picture in false colour, near red, far blue, PNG
    #[arg(long)]
    pub(super) preview: Option<PathBuf>,
    /// Also write the points that are seen, in the camera's frame, PLY
    #[arg(long)]
    pub(super) points: Option<PathBuf>,
    /// Sensor model to apply: JSON as `ppa depth fit-noise` writes it, or `default`
    #[arg(long)]
    pub(super) sensor: Option<PathBuf>,
    /// Seed of the sensor's noise and of the tremor
    #[arg(long, default_value_t = 0)]
    pub(super) seed: u64,
    /// Number of frames to record
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..=10_000))]
    pub(super) frames: u64,
    /// Standard deviation of the meshes' motion between frames along each axis, mm
    #[arg(long, default_value_t = 0.0)]
    pub(super) tremor_mm: f64,
    /// Standard deviation of the meshes' rotation about each axis, degrees
    #[arg(long, default_value_t = 0.0)]
    pub(super) tremor_deg: f64,
    #[command(flatten)]
    pub(super) replace: ReplaceArgs,
}

/// Reads a sensor from a file, or returns the default one.
pub(super) fn read_sensor(path: &Path) -> anyhow::Result<SensorSpec> {
    if path.as_os_str() == "default" {
        return Ok(SensorSpec::default());
    }
    crate::commands::read_json(path)
}

impl RenderArgs {
    /// The path of the case, if a case rather than meshes is to be rendered.
    pub fn case(&self) -> anyhow::Result<Option<&Path>> {
        if let [case] = &self.meshes[..]
            && is_case(case)
        {
            return Ok(Some(case));
        }
        if let Some(case) = self.meshes.iter().find(|path| is_case(path)) {
            bail!("{} is a case: render it alone", case.display());
        }
        if let Some(option) = self.of_case.given() {
            bail!(
                "{option} applies only to a case, but {} is a mesh",
                self.meshes[0].display()
            );
        }
        Ok(None)
    }
}

/// Whether a file is a case rather than a mesh.
fn is_case(path: &Path) -> bool {
    path.extension()
        .is_some_and(|extension| extension.eq_ignore_ascii_case("toml"))
}

/// `name.png` as `name_left.png`, if a view is named.
pub(super) fn of_view(path: &Path, view: Option<View>) -> PathBuf {
    let Some(view) = view else {
        return path.to_owned();
    };
    let [stem, extension] = [path.file_stem(), path.extension()]
        .map(|part| part.unwrap_or_default().to_string_lossy().into_owned());
    path.with_file_name(format!("{stem}_{}.{extension}", name(view)))
}

/// Name of a camera for users.
pub(super) fn name(view: View) -> &'static str {
    match view {
        View::Left => "left",
        View::Right => "right",
    }
}

/// Writes the other files of an image, with the camera's name if there are several images.
pub(super) fn write_others(
    args: &RenderArgs,
    view: Option<View>,
    camera: &Camera,
    image: &DepthImage,
) -> anyhow::Result<()> {
    if let Some(path) = &args.exr {
        image.write_exr(&of_view(path, view))?;
    }
    if let Some(path) = &args.preview {
        image.write_preview(&of_view(path, view))?;
    }
    if let Some(path) = &args.points {
        image.write_points(camera, &of_view(path, view))?;
    }
    Ok(())
}
