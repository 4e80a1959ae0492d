//! `ppa depth coverage`: camera positions that see most of a joint.

use std::path::{Path, PathBuf};

use anyhow::Context;
use clap::Args;
use ppa_dataset::write_whole;
use ppa_depth::{CoverageSettings, Viewpoint, isometry_from_rows};
use ppa_generate::{CameraPlace, Case, JointInRoom, Plan, RankedPlace, SceneSetup};
use ppa_report::{RankedView, coverage_plot};
use serde::Deserialize;

use super::coverage_table::{describe, table_csv};
use crate::findings::prepared;
use crate::interrupt::{NOTHING_WRITTEN, ends_at_once};
use crate::output::{Output, working};
use crate::output_files::ReplaceArgs;

#[derive(Debug, Args)]
pub struct CoverageArgs {
    /// Case written by `ppa prepare`
    case: PathBuf,
    /// Medial rotation of the limb in degrees
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true)]
    angle: f64,
    /// Take room, table, positioning and rig from this plan
    #[arg(long)]
    plan: Option<PathBuf>,
    /// Camera JSON for the places that are tried [default: an Azure Kinect, 640 x 576]
    #[arg(long)]
    camera: Option<PathBuf>,
    /// Distances from the joint that are tried, mm
    #[arg(long, value_delimiter = ',', default_value = "600,800,1000")]
    distances_mm: Vec<f64>,
    /// Angle between neighbouring places, degrees
    #[arg(long, default_value_t = 15.0)]
    step_deg: f64,
    /// Lowest place above the horizontal through the joint, degrees
    #[arg(long, default_value_t = 15.0, allow_negative_numbers = true)]
    lowest_deg: f64,
    /// Try these places instead: JSON, [{"name": …, "room_from_camera": row-major 4x4, mm}, …]
    #[arg(long, conflicts_with_all = ["distances_mm", "step_deg", "lowest_deg"])]
    places: Option<PathBuf>,
    /// Distance from the joint within which the surface counts, mm
    #[arg(long, default_value_t = CoverageSettings::default().radius_mm)]
    radius_mm: f64,
    /// Largest angle of incidence, degrees
    #[arg(long, default_value_t = CoverageSettings::default().max_angle_deg)]
    max_angle_deg: f64,
    /// Also write the table as CSV
    #[arg(long)]
    csv: Option<PathBuf>,
    /// Also draw the places and what they see, PNG
    #[arg(long)]
    plot: Option<PathBuf>,
    #[command(flatten)]
    replace: ReplaceArgs,
}

/// Largest number of positions: an image is rendered for each.
const MOST_PLACES: usize = 10_000;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct NamedPlace {
    name: String,
    room_from_camera: [[f64; 4]; 4],
}

pub fn run(args: &CoverageArgs, output: Output) -> anyhow::Result<()> {
    let mut outputs = args.replace.outputs();
    outputs.optional("--csv", args.csv.as_ref(), &[".csv"])?;
    outputs.optional("--plot", args.plot.as_ref(), &[".png"])?;
    let stoppable = ends_at_once(NOTHING_WRITTEN)?;
    let plan = match &args.plan {
        Some(path) => Plan::read(path)?,
        None => Plan::new(Vec::new()),
    };
    let case = Case::read(&args.case)?;
    let working = working("looking at the joint from all places");
    let prepared = prepared(&case, &args.case)?;
    let setup = SceneSetup::of_plan(&plan)?;
    let angle_rad = args.angle.to_radians();
    let joint = JointInRoom::new(&setup, &prepared, angle_rad, plan.positioning)?;
    let settings = CoverageSettings {
        radius_mm: args.radius_mm,
        max_angle_deg: args.max_angle_deg,
    };
    let study = joint.rank(&places(args, &joint)?, &settings)?;
    drop(stoppable);
    working.finish_and_clear();
    if let Some(path) = &args.csv {
        write_whole(path, &table_csv(&study.places)?)?;
    }
    if let Some(path) = &args.plot {
        draw(path, &study.places)?;
    }
    output.print(&study, describe)
}

/// The cameras of the rig, and the positions to try.
fn places(args: &CoverageArgs, joint: &JointInRoom) -> anyhow::Result<Vec<CameraPlace>> {
    let camera = super::read_camera(args.camera.as_ref())?;
    camera.rays(); // once, and shared by all clones
    let mut places = joint.rig();
    if let Some(path) = &args.places {
        let named: Vec<NamedPlace> = crate::commands::read_json(path)?;
        for place in named {
            let room_from_camera = isometry_from_rows(&place.room_from_camera)
                .with_context(|| format!("place {} of {}", place.name, path.display()))?;
            places.push(CameraPlace {
                name: place.name,
                camera: camera.clone(),
                room_from_camera,
            });
        }
        return Ok(places);
    }
    anyhow::ensure!(
        (1.0..=90.0).contains(&args.step_deg),
        "--step-deg is {}, expected 1 to 90",
        args.step_deg
    );
    anyhow::ensure!(
        (-90.0..=90.0).contains(&args.lowest_deg),
        "--lowest-deg is {}, expected -90 to 90",
        args.lowest_deg
    );
    let odd = |mm: &&f64| !(1.0..=1e5).contains(*mm);
    if let Some(mm) = args.distances_mm.iter().find(odd) {
        anyhow::bail!("--distances-mm contains {mm}, expected 1 to 100000");
    }
    let dome = Viewpoint::dome(args.step_deg, args.lowest_deg, &args.distances_mm);
    anyhow::ensure!(
        dome.len() <= MOST_PLACES,
        "{} places to try, expected at most {MOST_PLACES}: use a larger --step-deg",
        dome.len()
    );
    places.extend(dome.into_iter().map(|viewpoint| CameraPlace {
        name: "dome".to_owned(),
        camera: camera.clone(),
        room_from_camera: viewpoint.frame_from_camera(&joint.joint),
    }));
    Ok(places)
}

fn draw(path: &Path, places: &[RankedPlace]) -> anyhow::Result<()> {
    let views: Vec<RankedView> = places
        .iter()
        .map(|place| RankedView {
            viewpoint: place.viewpoint,
            coverage: place.coverage,
        })
        .collect();
    let mut png = std::io::Cursor::new(Vec::new());
    coverage_plot(&views).write_to(&mut png, image::ImageFormat::Png)?;
    Ok(write_whole(path, png.get_ref())?)
}
