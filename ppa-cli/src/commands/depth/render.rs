//! `ppa depth render`: depth images of meshes, ideal or with sensor errors.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use clap::Args;
use nalgebra::{Isometry3, Point3};
use ppa_core::TransformRows;
use ppa_dataset::layout::View;
use ppa_depth::{
    Backdrop, Body, Camera, DepthImage, MeshBody, PlacedBody, Sensor, SensorSpec, Tremor,
    isometry_from_rows, render,
};
use ppa_generate::body_of_cloud;
use ppa_mesh::{MeshContents, read_mesh_file};
use serde::{Deserialize, Serialize};

use super::render_case::{OfCase, is_case, of_view, render_case};
use crate::interrupt::Interrupt;
use crate::output::{Output, Seconds, Stopwatch};
use crate::output_files::ReplaceArgs;

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

/// The ideal camera or a sensor behind it.
enum Eye {
    Ideal,
    Sensor(Box<Sensor>, Box<Backdrop>),
}

pub fn run(args: &RenderArgs, output: Output) -> anyhow::Result<()> {
    if let [case] = &args.meshes[..]
        && is_case(case)
    {
        return render_case(case, args, output);
    }
    if let Some(case) = args.meshes.iter().find(|path| is_case(path)) {
        bail!("{} is a case: render it alone", case.display());
    }
    if let Some(option) = args.of_case.given() {
        bail!(
            "{option} belongs to a case, but {} is a mesh",
            args.meshes[0].display()
        );
    }
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
    let eye = eye(args, &camera)?;
    let tremor = Tremor {
        shift_mm: args.tremor_mm,
        turn_deg: args.tremor_deg,
        correlation_frames: TREMOR_FRAMES,
    };
    tremor.check()?;
    let corners = contents.iter().flat_map(|contents| &contents.cloud.points);
    let (sum, count) = corners.fold((nalgebra::Vector3::zeros(), 0), |(sum, n), corner| {
        (sum + corner.coords.cast::<f64>(), n + 1)
    });
    let pivot = camera_from_body * Point3::from(sum / f64::from(count.max(1)));
    camera.rays();
    let watch = Stopwatch::start();
    let mut bodies = Vec::new();
    for (path, contents) in args.meshes.iter().zip(&contents) {
        bodies.push(body(contents).with_context(|| path.display().to_string())?);
    }
    let see = |frame: u64| {
        let camera_from_body = tremor.motion(&pivot, args.seed, frame) * camera_from_body;
        let placed = |body| PlacedBody {
            body,
            camera_from_body,
        };
        let placed: Vec<_> = bodies.iter().map(placed).collect();
        for (path, placed) in args.meshes.iter().zip(&placed) {
            placed
                .require_camera_outside()
                .with_context(|| path.display().to_string())?;
        }
        let image = match &eye {
            Eye::Ideal => {
                let image = render(&camera, &placed);
                image.require_visible()?;
                image
            }
            Eye::Sensor(sensor, backdrop) => {
                let seen = backdrop.before(&camera, &placed)?;
                let image = sensor.observe(&camera, &seen, args.seed, frame);
                image.require_measured(seen.image.valid_pixels())?;
                image
            }
        };
        anyhow::Ok(image)
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
    write_others(args, None, &camera, &image)?;
    let rendered = Rendered {
        width: image.width,
        height: image.height,
        frames: args.frames,
        valid_pixels: image.valid_pixels(),
        too_far_pixels,
        min_mm: image.min_mm(),
        max_mm: image.max_mm(),
        sensor: match eye {
            Eye::Ideal => None,
            Eye::Sensor(sensor, _) => Some(sensor.spec().clone()),
        },
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

/// Triangles, or discs at the points of a cloud.
fn body(contents: &MeshContents) -> anyhow::Result<Body> {
    if contents.triangles.is_empty() {
        return Ok(body_of_cloud(&contents.cloud)?);
    }
    let mesh = MeshBody::new(&contents.cloud.points, &contents.triangles)?;
    Ok(Body::Mesh(mesh))
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

fn eye(args: &RenderArgs, camera: &Camera) -> anyhow::Result<Eye> {
    let Some(path) = &args.sensor else {
        return Ok(Eye::Ideal);
    };
    let spec = read_sensor(path)?;
    let sensor = Sensor::new(spec, args.seed).with_context(|| path.display().to_string())?;
    Ok(Eye::Sensor(
        Box::new(sensor),
        Box::new(Backdrop::new(camera, &[])),
    ))
}

impl RenderArgs {
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
