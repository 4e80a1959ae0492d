//! `ppa depth render`: depth images of meshes, ideal or with sensor errors.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use clap::{Args, ValueEnum};
use nalgebra::Isometry3;
use ppa_core::TransformRows;
use ppa_dataset::layout::View;
use ppa_depth::{
    Camera, DepthImage, PlacedBody, RecordError, Recorder, Sensor, SensorSpec, Tremor,
    isometry_from_rows, mean_point,
};
use ppa_generate::body_of_contents;
use ppa_mesh::read_mesh_file;
use serde::{Deserialize, Serialize};

use crate::commands::scene::WhichRoom;
use crate::interrupt::Interrupt;
use crate::output::{Output, Seconds, Stopwatch};
use crate::output_files::ReplaceArgs;

#[derive(Debug, Args)]
pub(super) struct OfCase {
    /// Medial rotation of a case's limb, degrees [default: 0]
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    pub(super) angle: Option<f64>,
    /// One of the two cameras of a case's room [default: both]
    #[arg(long, value_enum)]
    view: Option<ViewName>,
    #[command(flatten)]
    pub(super) room: WhichRoom,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum ViewName {
    Left,
    Right,
}

impl OfCase {
    /// The first option that only a case has.
    fn given(&self) -> Option<&'static str> {
        let given = [
            ("--angle", self.angle.is_some()),
            ("--view", self.view.is_some()),
            ("--plan or --room", self.room.is_given()),
        ];
        given
            .into_iter()
            .find(|(_, given)| *given)
            .map(|(name, _)| name)
    }

    /// The camera that was chosen.
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
    meshes: Vec<PathBuf>,
    #[command(flatten)]
    pub(super) of_case: OfCase,
    /// Camera JSON [default: an Azure Kinect, 640 x 576]
    #[arg(long)]
    pub(super) camera: Option<PathBuf>,
    /// JSON with the row-major 4x4 motion from the meshes' frame to the camera's, mm, or what `ppa scene --frames` wrote, with
    /// --motion [default: identity]
    #[arg(long)]
    pub(super) camera_from_mesh: Option<PathBuf>,
    /// Which motion of such a file: left_from_room for a room or a placed skin, left_from_ct for a skin in the scan
    #[arg(long, value_name = "NAME", requires = "camera_from_mesh")]
    motion: Option<String>,
    /// Image to write: 16-bit PNG, Z in mm, 0 invalid; of several frames name_0000.png, name_0001.png …; of a case
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
    /// See through a sensor: JSON as `fit-noise` writes it, or the word default
    #[arg(long)]
    pub(super) sensor: Option<PathBuf>,
    /// Seed of the sensor's noise and of the tremor
    #[arg(long, default_value_t = 0)]
    pub(super) seed: u64,
    /// Frames of a recording
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..=10_000))]
    pub(super) frames: u64,
    /// Size of the meshes' motion between frames along each axis, mm (standard deviation)
    #[arg(long, default_value_t = 0.0)]
    pub(super) tremor_mm: f64,
    /// Size of their rotation about each axis, degrees (standard deviation)
    #[arg(long, default_value_t = 0.0)]
    pub(super) tremor_deg: f64,
    #[command(flatten)]
    pub(super) replace: ReplaceArgs,
}

/// Frames over which a tremor remembers: a third of a second at 30 frames per second.
const TREMOR_FRAMES: f64 = 10.0;

/// A row-major 4x4 matrix, as four rows or as 16 numbers, or several of them by name.
#[derive(Debug, Deserialize)]
#[serde(untagged)]
enum Pose {
    Rows(TransformRows),
    Flat([f64; 16]),
    Named {
        motions: BTreeMap<String, [[f64; 4]; 4]>,
    },
}

#[derive(Debug, Serialize)]
struct Rendered {
    width: u32,
    height: u32,
    frames: u64,
    valid_pixels: usize,
    /// Pixels farther than a 16-bit PNG can say, 0 in the file; of the first frame.
    too_far_pixels: usize,
    min_mm: Option<f32>,
    max_mm: Option<f32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    sensor: Option<SensorSpec>,
    seed: u64,
    #[serde(flatten)]
    seconds: Seconds,
}

pub fn run(args: &RenderArgs, output: Output) -> anyhow::Result<()> {
    declare(args)?;
    let camera = super::read_camera(args.camera.as_ref())?;
    let camera_from_body = match &args.camera_from_mesh {
        Some(path) => read_pose(path, args.motion.as_deref())?,
        None => Isometry3::identity(),
    };
    let contents = args
        .meshes
        .iter()
        .map(|path| read_mesh_file(path))
        .collect::<Result<Vec<_>, _>>()?;
    let tremor = Tremor {
        shift_mm: args.tremor_mm,
        turn_deg: args.tremor_deg,
        correlation_frames: TREMOR_FRAMES,
    };
    let recorder = Recorder::new(camera, sensor(args)?, tremor, args.seed)?;
    let points = contents.iter().flat_map(|contents| &contents.cloud.points);
    let pivot = camera_from_body * mean_point(points);
    let watch = Stopwatch::start();
    let mut bodies = Vec::new();
    for (path, contents) in args.meshes.iter().zip(&contents) {
        bodies.push(body_of_contents(contents).with_context(|| path.display().to_string())?);
    }
    let placed = |body| PlacedBody {
        body,
        camera_from_body,
    };
    let placed: Vec<_> = bodies.iter().map(placed).collect();
    let see = |frame: u64| match recorder.frame(&placed, &pivot, frame) {
        Err(RecordError::Body { body, source }) => {
            Err(source).with_context(|| args.meshes[body].display().to_string())
        }
        seen => Ok(seen?),
    };
    let interrupt = Interrupt::listen()?;
    let image = see(0)?;
    let seconds = watch.read();
    let too_far_pixels = image.write_png(&args.frame(0))?;
    for frame in 1..args.frames {
        if interrupt.is_asked() {
            return Err(interrupt.stopped(format!(
                "after {frame} of {} frames; repeat the command with --replace to start over",
                args.frames
            )));
        }
        see(frame)?.write_png(&args.frame(frame))?;
    }
    write_others(args, None, recorder.camera(), &image)?;
    let rendered = Rendered {
        width: image.width,
        height: image.height,
        frames: args.frames,
        valid_pixels: image.valid_pixels(),
        too_far_pixels,
        min_mm: image.min_mm(),
        max_mm: image.max_mm(),
        sensor: recorder.sensor().map(|sensor| sensor.spec().clone()),
        seed: args.seed,
        seconds,
    };
    output.print(&rendered, |r| {
        let too_far = match r.too_far_pixels {
            0 => String::new(),
            pixels => format!("; {pixels} of them, beyond 65.535 m, are 0 in the file"),
        };
        format!(
            "{}: {} of {} x {} pixels see a surface{too_far}",
            args.out.display(),
            r.valid_pixels,
            r.width,
            r.height
        )
    })
}

fn read_pose(path: &Path, name: Option<&str>) -> anyhow::Result<Isometry3<f64>> {
    let rows = match (crate::commands::read_json(path)?, name) {
        (Pose::Rows(rows), None) => rows,
        (Pose::Flat(flat), None) => {
            std::array::from_fn(|r| std::array::from_fn(|c| flat[4 * r + c]))
        }
        (Pose::Named { motions }, name) => {
            let known = || motions.keys().cloned().collect::<Vec<_>>().join(", ");
            let name = name.with_context(|| {
                format!(
                    "{} holds several motions; --motion chooses one of {}",
                    path.display(),
                    known()
                )
            })?;
            *motions.get(name).with_context(|| {
                format!("{} holds no motion {name}, but {}", path.display(), known())
            })?
        }
        (_, Some(name)) => bail!(
            "{} holds one matrix without a name, not the motion {name}",
            path.display()
        ),
    };
    isometry_from_rows(&rows).with_context(|| path.display().to_string())
}

/// A sensor from a file, or the default one.
pub(super) fn read_sensor(path: &Path) -> anyhow::Result<SensorSpec> {
    if path.as_os_str() == "default" {
        return Ok(SensorSpec::default());
    }
    crate::commands::read_json(path)
}

fn sensor(args: &RenderArgs) -> anyhow::Result<Option<Sensor>> {
    let Some(path) = &args.sensor else {
        return Ok(None);
    };
    let sensor = Sensor::new(read_sensor(path)?, args.seed);
    Ok(Some(sensor.with_context(|| path.display().to_string())?))
}

impl RenderArgs {
    /// The case, if it is one that is to be rendered and no meshes.
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
                "{option} belongs to a case, but {} is a mesh",
                self.meshes[0].display()
            );
        }
        Ok(None)
    }

    /// The file of a frame.
    fn frame(&self, frame: u64) -> PathBuf {
        if self.frames == 1 {
            return self.out.clone();
        }
        let stem = self.out.file_stem().unwrap_or_default().to_string_lossy();
        self.out.with_file_name(format!("{stem}_{frame:04}.png"))
    }
}

fn declare(args: &RenderArgs) -> anyhow::Result<()> {
    let mut outputs = args.replace.outputs();
    for frame in 0..args.frames {
        outputs.file("--out", &args.frame(frame), &[".png"])?;
    }
    outputs.optional("--exr", args.exr.as_ref(), &[".exr"])?;
    outputs.optional("--preview", args.preview.as_ref(), &[".png"])?;
    outputs.optional("--points", args.points.as_ref(), &[".ply"])
}

/// Whether a file is a case and no mesh.
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

/// Name of a camera, as users read it.
pub(super) fn name(view: View) -> &'static str {
    match view {
        View::Left => "left",
        View::Right => "right",
    }
}

/// Writes the other files of an image, with the camera's name if there are several.
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
