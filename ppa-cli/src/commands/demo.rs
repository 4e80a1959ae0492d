//! `ppa demo`: from the built-in phantom to a small dataset and a contact sheet.

use std::path::{Path, PathBuf};

use anyhow::Context;
use clap::Args;
use ppa_core::text::count;
use ppa_ct::{ReadOptions, write_nifti};
use ppa_dataset::layout::LimbId;
use ppa_dataset::write_whole;
use ppa_generate::{GenerateSettings, Plan, PlanCase, Summary, prepare};
use ppa_mesh::LimbSettings;
use ppa_phantom::{LowerLeg, TableTop};
use ppa_report::contact_sheet;
use ppa_scene::{LandmarkOverrides, Side, Sweep};
use serde::Serialize;

use super::generate::with_progress;
use crate::interrupt::Interrupt;
use crate::output::{Output, Seconds, Stopwatch, working};
use crate::output_files::{ReplaceArgs, require_same, require_writable};
use crate::progress::ProgressArgs;

#[derive(Debug, Args)]
pub struct DemoArgs {
    /// Folder for everything the demo makes
    #[arg(long, default_value = "ppa-demo")]
    out: PathBuf,
    /// Seed of the dataset, at most 2^63 - 1 (the largest integer of TOML)
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u64).range(..=i64::MAX as u64))]
    seed: u64,
    /// Right lower leg to take: P01 to P17
    #[arg(long, value_name = "NAME", default_value = "P01")]
    phantom: String,
    #[command(flatten)]
    replace: ReplaceArgs,
    #[command(flatten)]
    progress: ProgressArgs,
}

/// Side of the phantom's voxels, mm: fine enough for open joint gutters in the radiographs.
const SPACING_MM: f64 = 0.8;

/// Neutral, the mortise view of P01 at 18 degrees, and on to the lateral view.
const POSES: Sweep = Sweep {
    from_deg: 0.0,
    to_deg: 90.0,
    step_deg: 18.0,
};

#[derive(Debug, Serialize)]
struct Demo {
    contact_sheet: PathBuf,
    #[serde(flatten)]
    dataset: Summary,
    #[serde(flatten)]
    seconds: Seconds,
}

pub fn run(args: &DemoArgs, output: Output) -> anyhow::Result<()> {
    let watch = Stopwatch::start();
    let leg = LowerLeg::family(&args.phantom, Side::Right)?;
    let out = &args.out;
    require_writable("--out", out)?;
    std::fs::create_dir_all(out)
        .with_context(|| format!("cannot create folder {}", out.display()))?;
    let plan = write_inputs(args, &leg)?;
    let interrupt = Interrupt::listen()?;
    let settings = GenerateSettings {
        stop: Some(interrupt.flag()),
        replace: args.replace.is_given(),
        ..GenerateSettings::default()
    };
    let dataset = with_progress(
        &plan,
        &out.join("dataset"),
        &settings,
        &args.progress.watch("pose", output),
        &interrupt,
    )?;
    let limb = LimbId {
        patient: 0,
        side: Side::Right,
    };
    let poses = POSES.poses()?.len();
    let sheet = contact_sheet(&out.join("dataset"), limb, poses)?;
    let path = out.join("contact_sheet.png");
    let mut png = std::io::Cursor::new(Vec::new());
    sheet.write_to(&mut png, image::ImageFormat::Png)?;
    require_same(&path, png.get_ref(), args.replace)?;
    write_whole(&path, png.get_ref())?;
    let demo = Demo {
        contact_sheet: path,
        dataset,
        seconds: watch.read(),
    };
    output.print(&demo, |demo| {
        format!(
            "{} and {} in {} ({:.0} s)\nLook at {}",
            count(demo.dataset.depth_images, "depth image"),
            count(demo.dataset.radiographs, "radiograph"),
            out.join("dataset").display(),
            demo.seconds.wall_s,
            demo.contact_sheet.display()
        )
    })
}

/// Writes phantom, case and plan as files that other commands accept too.
fn write_inputs(args: &DemoArgs, leg: &LowerLeg) -> anyhow::Result<Plan> {
    let working = working("voxelising the phantom");
    let volume = leg.voxelise(SPACING_MM, TableTop::Present)?;
    let (out, name) = (&args.out, args.phantom.to_ascii_lowercase());
    let scan = out.join(format!("{name}.nii.gz"));
    keep_or_write(&scan, args.replace, |path| Ok(write_nifti(path, &volume)?))?;
    working.set_message("finding the limb");
    let (surface, choices) = (LimbSettings::default(), LandmarkOverrides::default());
    let (case, _) = prepare(
        &scan,
        &ReadOptions::default(),
        Side::Right,
        &surface,
        &choices,
    )?;
    let case_file = PathBuf::from(format!("{name}.case.toml"));
    keep_or_write(&out.join(&case_file), args.replace, |path| {
        Ok(case.write(path)?)
    })?;
    let mut plan = Plan::new(vec![PlanCase {
        file: out.join(case_file),
        patient: 0,
    }]);
    plan.seed = args.seed;
    plan.rotation = POSES;
    let file = out.join("dataset.toml");
    keep_or_write(&file, args.replace, |path| Ok(plan.write(path)?))?;
    working.finish_and_clear();
    Ok(Plan::read(&file)?)
}

/// Writes a file unless it already has the same contents. A file with other contents is refused without `--replace`.
fn keep_or_write(
    path: &Path,
    replace: ReplaceArgs,
    write: impl FnOnce(&Path) -> anyhow::Result<()>,
) -> anyhow::Result<()> {
    // In the same folder, since a case names its scan relative to it.
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let new = path.with_file_name(format!(".new.{name}"));
    let written = write(&new).and_then(|()| {
        let bytes =
            std::fs::read(&new).with_context(|| format!("cannot read {}", new.display()))?;
        require_same(path, &bytes, replace)?;
        std::fs::rename(&new, path).with_context(|| format!("cannot write {}", path.display()))
    });
    if written.is_err() {
        // The first error is the one to report.
        let _ = std::fs::remove_file(&new);
    }
    written
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_edited_input_of_the_demo_is_kept() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("p01.case.toml");
        let put = |text: &'static str, replace: bool| {
            let replace = ReplaceArgs::default().or(replace);
            keep_or_write(&path, replace, |new| Ok(std::fs::write(new, text)?))
        };
        let read = || std::fs::read_to_string(&path).unwrap();
        put("made", false).unwrap();
        put("made", false).unwrap();
        std::fs::write(&path, "edited").unwrap();
        let refused = put("made", false).unwrap_err().to_string();
        assert!(refused.contains("give --replace"), "{refused}");
        assert_eq!(read(), "edited");
        put("made", true).unwrap();
        assert_eq!(read(), "made");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
