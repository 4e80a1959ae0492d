//! `ppa depth render CASE`: depth images of a case's limb on the table, from both cameras of a room.

use std::path::{Path, PathBuf};

use anyhow::bail;
use ppa_dataset::BodyShape;
use ppa_dataset::layout::{LimbId, View};
use ppa_generate::{Case, DepthView, SceneSetup, VisibleLimb};
use serde::Serialize;

use super::render::{RenderArgs, name, of_view, read_sensor, write_others};
use crate::findings::prepared;
use crate::output::{Output, working};

/// Declares the output files for the images of a case.
fn declare(args: &RenderArgs) -> anyhow::Result<()> {
    let mut outputs = args.replace.outputs();
    let views: &[Option<View>] = match args.of_case.view() {
        Some(_) => &[None],
        None => &[Some(View::Left), Some(View::Right)],
    };
    for &view in views {
        let of = |path: &PathBuf| of_view(path, view);
        outputs.file("--out", &of(&args.out), &[".png"])?;
        outputs.optional("--exr", args.exr.as_ref().map(of).as_ref(), &[".exr"])?;
        outputs.optional(
            "--preview",
            args.preview.as_ref().map(of).as_ref(),
            &[".png"],
        )?;
        outputs.optional("--points", args.points.as_ref().map(of).as_ref(), &[".ply"])?;
    }
    Ok(())
}

#[derive(Debug, Serialize)]
struct RenderedCase {
    angle_deg: f64,
    views: Vec<RenderedView>,
}

#[derive(Debug, Serialize)]
struct RenderedView {
    view: &'static str,
    file: PathBuf,
    width: u32,
    height: u32,
    valid_pixels: usize,
    too_far_pixels: usize,
    min_mm: Option<f32>,
    max_mm: Option<f32>,
}

pub fn run(path: &Path, args: &RenderArgs, output: Output) -> anyhow::Result<()> {
    refuse_options_of_meshes(path, args)?;
    declare(args)?;
    let mut plan = args.of_case.room.plan()?;
    if let Some(sensor) = &args.sensor {
        plan.depth.sensor = Some(read_sensor(sensor)?);
    }
    let case = Case::read(path)?;
    let working = working("preparing the limb");
    let setup = SceneSetup::of_plan(&plan)?;
    let limb = VisibleLimb::new(prepared(&case, path)?)?;
    let angle_deg = args.of_case.angle.unwrap_or_default();
    let limb = match args.of_case.shape {
        None | Some(BodyShape::Orig) => limb,
        Some(shape) => {
            let patient = plan.patient_of(path).unwrap_or(0);
            let side = case.side;
            limb.with_shape(shape, &plan, LimbId { patient, side })?
        }
    };
    let mut views = limb.depth_views(&setup, &plan, angle_deg, args.seed)?;
    let wanted = args.of_case.view();
    views.retain(|seen| wanted.is_none_or(|view| view == seen.view));
    let mut written = Vec::new();
    for seen in &views {
        // A single image keeps the given name.
        let named = wanted.is_none().then_some(seen.view);
        written.push(write_view(args, named, seen)?);
    }
    working.finish_and_clear();
    let rendered = RenderedCase {
        angle_deg,
        views: written,
    };
    output.print(&rendered, |rendered| {
        let line = |seen: &RenderedView| {
            let range = match (seen.min_mm, seen.max_mm) {
                (Some(min), Some(max)) => format!(", {min:.0} to {max:.0} mm away"),
                _ => String::new(),
            };
            format!(
                "{}: {} of {} x {} pixels see a surface{range}",
                seen.file.display(),
                seen.valid_pixels,
                seen.width,
                seen.height
            )
        };
        let lines: Vec<_> = rendered.views.iter().map(line).collect();
        lines.join("\n")
    })
}

fn write_view(
    args: &RenderArgs,
    named: Option<View>,
    seen: &DepthView,
) -> anyhow::Result<RenderedView> {
    let file = of_view(&args.out, named);
    let image = &seen.image;
    let too_far_pixels = image.write_png(&file)?;
    write_others(args, named, &seen.camera, image)?;
    Ok(RenderedView {
        view: name(seen.view),
        file,
        width: image.width,
        height: image.height,
        valid_pixels: image.valid_pixels(),
        too_far_pixels,
        min_mm: image.min_mm(),
        max_mm: image.max_mm(),
    })
}

/// Refuses options of meshes: the room of a case defines its cameras.
fn refuse_options_of_meshes(path: &Path, args: &RenderArgs) -> anyhow::Result<()> {
    let given = [
        ("--camera", args.camera.is_some()),
        ("--camera-from-mesh", args.camera_from_mesh.is_some()),
        ("--frames", args.frames != 1),
        ("--tremor-mm", args.tremor_mm != 0.0),
        ("--tremor-deg", args.tremor_deg != 0.0),
    ];
    if let Some((option, _)) = given.into_iter().find(|(_, given)| *given) {
        bail!(
            "{option} applies only to meshes, but {} is a case: its cameras are those of --plan or --room",
            path.display()
        );
    }
    Ok(())
}
