//! `ppa depth render MESH…`: depth images of meshes, ideal or with sensor errors.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use nalgebra::Isometry3;
use ppa_core::TransformRows;
use ppa_depth::{
    PlacedBody, RecordError, Recorder, Sensor, SensorSpec, Tremor, isometry_from_rows, mean_point,
};
use ppa_generate::body_of_contents;
use ppa_mesh::read_mesh_file;
use serde::{Deserialize, Serialize};

use super::render::{RenderArgs, read_sensor, write_others};
use crate::interrupt::Interrupt;
use crate::output::{Output, Seconds, Stopwatch};

/// Correlation time of the tremor in frames: a third of a second at 30 frames per second.
const TREMOR_FRAMES: f64 = 10.0;

/// A row-major 4x4 matrix, as four rows or as 16 numbers, or several matrices by name.
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
    /// Pixels too far for a 16-bit PNG, which are 0 in the file; of the first frame.
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
                    "{} contains several motions; choose one with --motion: {}",
                    path.display(),
                    known()
                )
            })?;
            *motions.get(name).with_context(|| {
                format!(
                    "{} contains no motion {name}, only {}",
                    path.display(),
                    known()
                )
            })?
        }
        (_, Some(name)) => bail!(
            "{} contains one matrix without a name, not the motion {name}",
            path.display()
        ),
    };
    isometry_from_rows(&rows).with_context(|| path.display().to_string())
}

fn sensor(args: &RenderArgs) -> anyhow::Result<Option<Sensor>> {
    let Some(path) = &args.sensor else {
        return Ok(None);
    };
    let sensor = Sensor::new(read_sensor(path)?, args.seed);
    Ok(Some(sensor.with_context(|| path.display().to_string())?))
}

impl RenderArgs {
    /// Path of a frame's file.
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
