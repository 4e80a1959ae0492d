//! `ppa scene`: the table, and the limb on it.

use std::path::{Path, PathBuf};

use anyhow::Context;
use clap::{Args, Subcommand};
use ppa_core::text::{count, number};
use ppa_dataset::write_whole;
use ppa_generate::{Case, Frames, Plan, RoomFile, Table};
use ppa_mesh::{read_mesh_file, write_cloud_file, write_mesh_file};
use ppa_report::{PosedLimb, pose_picture, write_picture};
use ppa_scene::{Contact, PlaneSettings, SoftTissue, TablePlane, table_plane};
use serde::Serialize;

use crate::commands::pictures::shown_name;
use crate::findings::prepared;
use crate::number_lists::range;
use crate::output::{Output, working};
use crate::output_files::{CLOUD, MESH, PICTURE, ReplaceArgs};

#[derive(Debug, Subcommand)]
pub enum SceneCommand {
    /// Points and triangles of the x-ray room
    Room(RoomArgs),
    /// Table plane of a point cloud
    Plane(PlaneArgs),
    /// Lay the limb of a case on the table
    Place(PlaceArgs),
}

#[derive(Debug, Args)]
#[group(multiple = false)]
pub struct WhichRoom {
    /// Take room, soft tissue and positioning from this plan
    #[arg(long)]
    plan: Option<PathBuf>,
    /// Take the room from this room file
    #[arg(long = "room")]
    file: Option<PathBuf>,
}

impl WhichRoom {
    /// Whether a room was chosen.
    pub fn is_given(&self) -> bool {
        self.plan.is_some() || self.file.is_some()
    }

    pub fn plan(&self) -> anyhow::Result<Plan> {
        Ok(match (&self.plan, &self.file) {
            (Some(plan), _) => Plan::read(plan)?,
            (None, Some(file)) => Plan::in_room(file)?,
            (None, None) => Plan::new(Vec::new()),
        })
    }
}

#[derive(Debug, Args)]
pub struct RoomArgs {
    /// Room to write, mm: .ply or .obj; points as from a scanner, and triangles where known, as `ppa depth render` needs them
    #[arg(long)]
    out: PathBuf,
    #[command(flatten)]
    room: WhichRoom,
    /// Room file to write, for editing: the current room, device, detector and cameras
    #[arg(long)]
    toml: Option<PathBuf>,
    /// Write the poses of device and cameras as JSON: named 4x4, mm
    #[arg(long)]
    frames: Option<PathBuf>,
    #[command(flatten)]
    replace: ReplaceArgs,
}

#[derive(Debug, Args)]
pub struct PlaneArgs {
    /// Point cloud, mm, z up: .ply, .obj or .stl
    cloud: PathBuf,
    /// Seed of the search
    #[arg(long, default_value_t = 0)]
    seed: u64,
}

#[derive(Debug, Args)]
pub struct PlaceArgs {
    /// Case written by `ppa prepare`
    case: PathBuf,
    /// Medial rotation in degrees
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true)]
    angle: f64,
    #[command(flatten)]
    room: WhichRoom,
    /// Write all poses, from the scan to the cameras, as JSON: named 4x4, mm
    #[arg(long)]
    frames: Option<PathBuf>,
    /// Indentation depth at the distal and the proximal contact, mm [default: the plan's, or 0,0: a rigid skin]
    #[arg(long, value_name = "DISTAL,PROXIMAL", value_parser = range)]
    soft_tissue_mm: Option<[f64; 2]>,
    /// Write the placed skin in room coordinates: .ply, .obj or .stl
    #[arg(long)]
    ply: Option<PathBuf>,
    /// Picture of the limb in the room, PNG: table, device, detector, both cameras' views and the points it rests on
    #[arg(long, value_name = "FILE")]
    picture: Option<PathBuf>,
    #[command(flatten)]
    replace: ReplaceArgs,
}

pub fn run(command: &SceneCommand, output: Output) -> anyhow::Result<()> {
    match command {
        SceneCommand::Room(args) => room(args, output),
        SceneCommand::Plane(args) => plane(args, output),
        SceneCommand::Place(args) => place_limb(args, output),
    }
}

#[derive(Debug, Serialize)]
struct FoundPlane {
    normal: [f64; 3],
    offset_mm: f64,
    inliers: usize,
    rms_mm: f64,
}

impl FoundPlane {
    fn describe(&self) -> String {
        let [x, y, z] = self.normal.map(number);
        format!(
            "normal ({x:.6}, {y:.6}, {z:.6}), offset {:.3} mm, {}, rms {:.3} mm",
            number(self.offset_mm),
            count(self.inliers, "inlier"),
            self.rms_mm
        )
    }
}

impl From<&TablePlane> for FoundPlane {
    fn from(found: &TablePlane) -> Self {
        Self {
            normal: found.plane.normal.into_inner().into(),
            offset_mm: found.plane.offset_mm,
            inliers: found.inliers,
            rms_mm: found.rms_mm,
        }
    }
}

#[derive(Debug, Serialize)]
struct RoomFacts {
    points: usize,
    table: FoundPlane,
    room_from_device: [[f64; 4]; 4],
}

fn room(args: &RoomArgs, output: Output) -> anyhow::Result<()> {
    let mut outputs = args.replace.outputs();
    outputs.file("--out", &args.out, CLOUD)?;
    outputs.optional("--toml", args.toml.as_ref(), &[".toml"])?;
    outputs.optional("--frames", args.frames.as_ref(), &[".json"])?;
    let plan = args.room.plan()?;
    let table = Table::of_plan(&plan)?;
    if let Some(path) = &args.frames {
        write_frames(path, &Frames::of_room(&table, &plan.depth.cameras()?)?)?;
    }
    if let Some(path) = &args.toml {
        RoomFile::of_plan(&plan)?.write(path)?;
    }
    let Table { room, plane } = table;
    match room.points_and_triangles() {
        // An STL file cannot hold points in addition to triangles: refused as for a cloud.
        Some(mesh) if !is_stl(&args.out) => write_mesh_file(&args.out, &mesh)?,
        _ => write_cloud_file(&args.out, &room.cloud)?,
    }
    let facts = RoomFacts {
        points: room.cloud.points.len(),
        table: FoundPlane::from(&plane),
        room_from_device: room.device.room_from_device.to_homogeneous_rows(),
    };
    output.print(&facts, |facts| {
        let table = facts.table.describe();
        format!(
            "{}: {}; table {table}",
            args.out.display(),
            count(facts.points, "point")
        )
    })
}

fn is_stl(path: &Path) -> bool {
    path.extension()
        .is_some_and(|extension| extension.eq_ignore_ascii_case("stl"))
}

fn write_frames(path: &Path, frames: &Frames) -> anyhow::Result<()> {
    let text = serde_json::to_string_pretty(frames)?;
    Ok(write_whole(path, text.as_bytes())?)
}

fn plane(args: &PlaneArgs, output: Output) -> anyhow::Result<()> {
    let cloud = read_mesh_file(&args.cloud)?.cloud;
    let found = table_plane(&cloud, &PlaneSettings::default(), args.seed)
        .with_context(|| args.cloud.display().to_string())?;
    output.print(&FoundPlane::from(&found), FoundPlane::describe)
}

#[derive(Debug, Serialize)]
struct Placed {
    #[serde(flatten)]
    contact: Contact,
    patient_from_ct: [[f64; 4]; 4],
    room_from_patient: [[f64; 4]; 4],
}

fn place_limb(args: &PlaceArgs, output: Output) -> anyhow::Result<()> {
    let mut outputs = args.replace.outputs();
    outputs.optional("--ply", args.ply.as_ref(), MESH)?;
    outputs.optional("--frames", args.frames.as_ref(), &[".json"])?;
    outputs.optional("--picture", args.picture.as_ref(), PICTURE)?;
    let plan = args.room.plan()?;
    let mut settings = plan.place_settings();
    if let Some([distal_mm, proximal_mm]) = args.soft_tissue_mm {
        settings.soft_tissue = SoftTissue {
            distal_mm,
            proximal_mm,
        };
    }
    let case = Case::read(&args.case)?;
    let working = working("preparing the limb");
    let prepared = prepared(&case, &args.case)?;
    let table = Table::of_plan(&plan)?;
    let skin = &prepared.limb.mesh;
    let (landmarks, angle_rad) = (&prepared.landmarks, args.angle.to_radians());
    let placement = table.place(skin, landmarks, angle_rad, &settings)?;
    let patient_from_ct = prepared.landmarks.patient_from_ct();
    if let Some(ply) = &args.ply {
        let room_from_ct = placement.room_from_patient * patient_from_ct;
        let mut lies = skin.transformed(room_from_ct.isometry());
        if placement.flattening.is_some() {
            lies.vertices = placement.in_room(&skin.vertices, &prepared.landmarks);
            lies.normals = lies.geometric_normals();
        }
        write_mesh_file(ply, &lies)?;
    }
    if let Some(path) = &args.frames {
        let frames = Frames::of_room(&table, &plan.depth.cameras()?)?;
        write_frames(
            path,
            &frames.with_limb(&placement, &prepared.landmarks, &table),
        )?;
    }
    if let Some(path) = &args.picture {
        let posed = PosedLimb {
            limb: &prepared,
            placement: &placement,
            angle_deg: args.angle,
            table: &table,
            plan: &plan,
            acknowledged: &case.acknowledged,
        };
        write_picture(path, &pose_picture(&shown_name(&args.case), &posed)?)?;
    }
    working.finish_and_clear();
    let placed = Placed {
        contact: placement.contact,
        patient_from_ct: patient_from_ct.to_homogeneous_rows(),
        room_from_patient: placement.room_from_patient.to_homogeneous_rows(),
    };
    output.print(&placed, |placed| {
        let c = &placed.contact;
        format!(
            "distal part {:.3} mm, proximal part {:.3} mm above the table; penetration {:.3} mm; {}",
            number(c.distal_mm),
            number(c.proximal_mm),
            number(c.penetration_mm),
            count(c.iterations, "iteration")
        )
    })
}
