//! `ppa depth coverage`: where a camera would see most of a joint.

use std::path::{Path, PathBuf};

use anyhow::Context;
use clap::Args;
use nalgebra::{Isometry3, Point3};
use ppa_dataset::write_whole;
use ppa_depth::{
    Camera, CoverageSettings, JointSurface, MeshBody, PlacedBody, Viewpoint, isometry_from_rows,
    rows_from_isometry,
};
use ppa_generate::{Case, Plan, SceneSetup, closed_skin};
use ppa_report::{RankedView, coverage_plot};
use ppa_scene::place;
use serde::Deserialize;

use super::coverage_table::{Row, Study, table_csv};
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
    /// Take room, table and rig from this plan
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
    /// Surface within this distance of the joint counts, mm
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

/// Most places that are tried: each is an image.
const MOST_PLACES: usize = 10_000;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct NamedPlace {
    name: String,
    room_from_camera: [[f64; 4]; 4],
}

/// A camera somewhere in the room.
struct Candidate {
    name: String,
    camera: Camera,
    room_from_camera: Isometry3<f64>,
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
    let table = &setup.table;
    let placement = place(
        &prepared.limb.mesh.vertices,
        &prepared.landmarks,
        args.angle.to_radians(),
        &table.plane.plane,
        &table.room.device,
    )?;
    let room_from_ct = placement.room_from_patient * prepared.landmarks.patient_from_ct();
    let room_from_ct = *room_from_ct.isometry();
    let joint_in_ct = Point3::from(prepared.landmarks.joint_centre);
    let joint = room_from_ct * joint_in_ct;
    let candidates = candidates(args, &setup, &joint)?;

    let settings = CoverageSettings {
        radius_mm: args.radius_mm,
        max_angle_deg: args.max_angle_deg,
    };
    let (skin, walls) = (&prepared.limb.mesh, &prepared.limb.walls);
    let mesh = MeshBody::new(&skin.vertices, &skin.triangles)?;
    let surface = JointSurface::new(&mesh, &joint_in_ct, &settings)?;
    // Where the scan cuts the limb no skin is to be seen, but what is behind is hidden.
    let limb = closed_skin(&walls.vertices(skin), skin, walls)?;
    let furniture = table.furniture()?;
    let see = |candidate: &Candidate| {
        let camera_from_room = candidate.room_from_camera.inverse();
        let scene = [
            PlacedBody {
                body: &limb,
                camera_from_body: camera_from_room * room_from_ct,
            },
            PlacedBody {
                body: &furniture,
                camera_from_body: camera_from_room,
            },
        ];
        let position = candidate.room_from_camera * Point3::origin();
        Row {
            rank: 0,
            name: candidate.name.clone(),
            viewpoint: Viewpoint::of(&position, &joint),
            coverage: surface.seen(&candidate.camera, &scene[0].camera_from_body, &scene),
            room_from_camera: rows_from_isometry(&candidate.room_from_camera),
        }
    };
    let mut rows: Vec<Row> = candidates.iter().map(see).collect();
    rows.sort_by(|a, b| a.coverage.best_first(&b.coverage));
    for (i, row) in rows.iter_mut().enumerate() {
        row.rank = i + 1;
    }
    drop(stoppable);
    working.finish_and_clear();
    if let Some(path) = &args.csv {
        write_whole(path, &table_csv(&rows)?)?;
    }
    if let Some(path) = &args.plot {
        draw(path, &rows)?;
    }
    let study = Study {
        joint_mm: joint.into(),
        surface_mm2: surface.area_mm2(),
        radius_mm: args.radius_mm,
        max_angle_deg: args.max_angle_deg,
        places: rows,
    };
    output.print(&study, Study::describe)
}

/// The cameras of the rig, and the places that are tried.
fn candidates(
    args: &CoverageArgs,
    setup: &SceneSetup,
    joint: &Point3<f64>,
) -> anyhow::Result<Vec<Candidate>> {
    let camera = super::read_camera(args.camera.as_ref())?;
    camera.rays(); // once, and shared by all clones
    let mut candidates: Vec<Candidate> = setup
        .cameras
        .iter()
        .map(|placed| Candidate {
            name: format!("rig {}", placed.view.name()),
            camera: placed.camera.clone(),
            room_from_camera: placed.camera_from_room.inverse(),
        })
        .collect();
    if let Some(path) = &args.places {
        let places: Vec<NamedPlace> = crate::commands::read_json(path)?;
        for place in places {
            let room_from_camera = isometry_from_rows(&place.room_from_camera)
                .with_context(|| format!("place {} of {}", place.name, path.display()))?;
            candidates.push(Candidate {
                name: place.name,
                camera: camera.clone(),
                room_from_camera,
            });
        }
        return Ok(candidates);
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
        anyhow::bail!("--distances-mm holds {mm}, expected 1 to 100000");
    }
    let dome = Viewpoint::dome(args.step_deg, args.lowest_deg, &args.distances_mm);
    anyhow::ensure!(
        dome.len() <= MOST_PLACES,
        "{} places are to be tried, expected at most {MOST_PLACES}: take a larger --step-deg",
        dome.len()
    );
    candidates.extend(dome.into_iter().map(|viewpoint| Candidate {
        name: "dome".to_owned(),
        camera: camera.clone(),
        room_from_camera: viewpoint.frame_from_camera(joint),
    }));
    Ok(candidates)
}

fn draw(path: &Path, rows: &[Row]) -> anyhow::Result<()> {
    let views: Vec<RankedView> = rows
        .iter()
        .map(|row| RankedView {
            viewpoint: row.viewpoint,
            coverage: row.coverage,
        })
        .collect();
    let mut png = std::io::Cursor::new(Vec::new());
    coverage_plot(&views).write_to(&mut png, image::ImageFormat::Png)?;
    Ok(write_whole(path, png.get_ref())?)
}
