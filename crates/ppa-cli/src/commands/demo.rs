//! `ppa demo`: from the built-in phantom to a small dataset and a contact sheet.

use std::path::{Path, PathBuf};

use anyhow::Context;
use clap::Args;
use ppa_ct::phantom::{LowerLeg, TableTop};
use ppa_ct::{ReadOptions, write_nifti};
use ppa_dataset::layout::LimbId;
use ppa_dataset::{Plan, PlanCase, Summary, contact_sheet, prepare, write_whole};
use ppa_mesh::LimbSettings;
use ppa_scene::{LandmarkOverrides, Side, Sweep};
use serde::Serialize;

use super::generate::with_progress;
use crate::output::{Output, Seconds, Stopwatch, working};

#[derive(Debug, Args)]
pub struct DemoArgs {
    /// Folder for everything the demo makes
    #[arg(long, default_value = "ppa-demo")]
    out: PathBuf,
    /// Seed of the dataset
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

/// Side of the phantom's voxels, mm: fine enough for open joint gutters in the radiographs.
const SPACING_MM: f64 = 0.8;

/// Neutral, the phantom's mortise view at 18 degrees, and on to the lateral view.
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
    let out = &args.out;
    std::fs::create_dir_all(out)
        .with_context(|| format!("cannot create folder {}", out.display()))?;
    let plan = write_inputs(out, args.seed)?;
    let dataset = with_progress(&plan, &out.join("dataset"))?;
    let limb = LimbId {
        patient: 0,
        side: Side::Right,
    };
    let poses = POSES.poses()?.len();
    let sheet = contact_sheet(&out.join("dataset"), limb, poses)?;
    let path = out.join("contact_sheet.png");
    let mut png = std::io::Cursor::new(Vec::new());
    sheet.write_to(&mut png, image::ImageFormat::Png)?;
    write_whole(&path, png.get_ref())?;
    let demo = Demo {
        contact_sheet: path,
        dataset,
        seconds: watch.read(),
    };
    output.print(&demo, |demo| {
        format!(
            "{} depth images and {} radiographs in {} ({:.0} s)\nLook at {}",
            demo.dataset.depth_images,
            demo.dataset.radiographs,
            out.join("dataset").display(),
            demo.seconds.wall_s,
            demo.contact_sheet.display()
        )
    })
}

/// Phantom, case and plan, as files that the other commands take as well.
fn write_inputs(out: &Path, seed: u64) -> anyhow::Result<Plan> {
    let working = working("voxelising the phantom");
    let volume = LowerLeg::p01().voxelise(SPACING_MM, TableTop::Present)?;
    let scan = out.join("p01.nii.gz");
    write_nifti(&scan, &volume)?;
    working.set_message("finding the limb");
    let (surface, choices) = (LimbSettings::default(), LandmarkOverrides::default());
    let (case, _) = prepare(
        &scan,
        &ReadOptions::default(),
        Side::Right,
        &surface,
        &choices,
    )?;
    case.write(&out.join("p01.case.toml"))?;
    let mut plan = Plan::new(vec![PlanCase {
        file: PathBuf::from("p01.case.toml"),
        patient: 0,
    }]);
    plan.seed = seed;
    plan.rotation = POSES;
    let file = out.join("dataset.toml");
    plan.write(&file)?;
    working.finish_and_clear();
    Ok(Plan::read(&file)?)
}
