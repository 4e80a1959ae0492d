//! From a scan of the phantom to a dataset of one pose: case, plan, depth images of both cameras, radiograph.
//!
//! `cargo run -p ppa-generate --example one_pose -- [FOLDER]`

use std::error::Error;
use std::path::PathBuf;

use ppa_generate::{GenerateSettings, Plan, PlanCase, generate, prepare};
use ppa_phantom::{LowerLeg, TableTop};
use ppa_scene::{Side, Sweep};
use ppa_xray::Detector;

fn main() -> Result<(), Box<dyn Error>> {
    let temporary = tempfile::tempdir()?;
    let folder = std::env::args_os().nth(1);
    let folder = folder.map_or(temporary.path().to_owned(), PathBuf::from);
    std::fs::create_dir_all(&folder)?;
    let (scan, file) = (folder.join("p01.nii"), folder.join("p01.case.toml"));
    ppa_ct::write(&scan, &LowerLeg::p01().voxelise(2.0, TableTop::Present)?)?;

    // The case records every decision about the limb, found or chosen.
    let all_found = (Default::default(), Default::default(), Default::default());
    let (case, _) = prepare(&scan, &all_found.0, Side::Right, &all_found.1, &all_found.2)?;
    case.write(&file)?;

    // One rotation, and few pixels and histories for a quick radiograph.
    let mut plan = Plan::new(vec![PlanCase { file, patient: 0 }]);
    plan.rotation = Sweep {
        from_deg: 18.0,
        to_deg: 18.0,
        step_deg: 1.0,
    };
    plan.xray.detector = Detector::centred(60, 60, 4.0);
    plan.xray.engine.scatter_histories = 2000;
    let dataset = folder.join("dataset");
    let made = generate(&plan, &dataset, &GenerateSettings::default(), &|_| {})?;
    println!(
        "{} depth images, {} radiograph",
        made.depth_images, made.radiographs
    );
    Ok(())
}
