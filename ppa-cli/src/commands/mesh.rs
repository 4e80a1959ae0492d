//! `ppa mesh`: surfaces of a CT, and clusters of points.

use std::path::PathBuf;

use clap::{Args, Subcommand};
use ppa_core::text::{count, count_as, number};
use ppa_dataset::{BodyShape, layout::LimbId};
use ppa_generate::{Case, ShapeSettings, body_shape};
use ppa_mesh::{
    Border, Bump, Displacement, Mesh, add_bumps, dbscan, iso_surface, read_mesh_file,
    write_mesh_file,
};
use serde::Serialize;

use crate::findings::prepared;
use crate::number_lists::bump;
use crate::output::{Output, Seconds, Stopwatch};
use crate::output_files::{MESH, ReplaceArgs};
use crate::scan_args::ScanArgs;

#[derive(Debug, Subcommand)]
pub enum MeshCommand {
    /// Iso-surface of a CT as PLY, OBJ or STL
    Extract(ExtractArgs),
    /// The skin of a case, or a body shape of it, as PLY, OBJ or STL
    Augment(AugmentArgs),
    /// DBSCAN clusters of a point cloud
    Cluster(ClusterArgs),
}

#[derive(Debug, Args)]
pub struct ExtractArgs {
    #[command(flatten)]
    scan: ScanArgs,
    /// Hounsfield units of the surface
    #[arg(long, default_value_t = -500.0, allow_negative_numbers = true)]
    iso: f32,
    /// Close the surface where the volume ends
    #[arg(long)]
    close: bool,
    /// File to write: .ply, .obj or .stl
    #[arg(long)]
    out: PathBuf,
    #[command(flatten)]
    replace: ReplaceArgs,
}

#[derive(Debug, Args)]
pub struct AugmentArgs {
    /// Case written by `ppa prepare`
    case: PathBuf,
    /// Body shape: orig, big, small, bumps_a or bumps_b
    #[arg(long, default_value = "orig", value_parser = body_shape_named)]
    shape: BodyShape,
    /// Shift of big and small in mm [default: 4]
    #[arg(long)]
    offset_mm: Option<f64>,
    /// Seed of the bumps of bumps_a and bumps_b: another one makes another variant
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// A further bump: position in the ct frame, height and width (sigma) in mm; negative heights are dents
    #[arg(long = "bump", value_name = "X,Y,Z,HEIGHT,SIGMA", value_parser = bump, allow_hyphen_values = true)]
    bumps: Vec<Bump>,
    /// File to write: .ply, .obj or .stl
    #[arg(long)]
    out: PathBuf,
    #[command(flatten)]
    replace: ReplaceArgs,
}

pub(super) fn body_shape_named(name: &str) -> Result<BodyShape, String> {
    let known = BodyShape::ALL
        .into_iter()
        .find(|shape| shape.name() == name);
    known.ok_or_else(|| {
        let names = BodyShape::ALL.map(BodyShape::name).join(", ");
        format!("expected one of {names}")
    })
}

#[derive(Debug, Args)]
pub struct ClusterArgs {
    /// Point cloud: .ply, .obj or .stl
    cloud: PathBuf,
    /// Largest distance between neighbours in mm
    #[arg(long)]
    eps_mm: f64,
    /// Points within --eps-mm that make a core point, itself included
    #[arg(long)]
    min_points: usize,
}

pub fn run(command: &MeshCommand, output: Output) -> anyhow::Result<()> {
    match command {
        MeshCommand::Extract(args) => extract(args, output),
        MeshCommand::Augment(args) => augment(args, output),
        MeshCommand::Cluster(args) => cluster(args, output),
    }
}

#[derive(Debug, Serialize)]
struct Surface {
    vertices: usize,
    triangles: usize,
    area_mm2: f64,
    volume_mm3: f64,
    components: usize,
    boundary_edges: usize,
    euler: i64,
    #[serde(flatten)]
    seconds: Seconds,
}

impl Surface {
    fn of(mesh: &Mesh, seconds: Seconds) -> Self {
        let topology = mesh.topology();
        Self {
            vertices: mesh.vertices.len(),
            triangles: mesh.triangles.len(),
            area_mm2: mesh.area_mm2(),
            volume_mm3: mesh.volume_mm3(),
            components: topology.components,
            boundary_edges: topology.boundary_edges,
            euler: topology.euler,
            seconds,
        }
    }

    fn describe(&self) -> String {
        format!(
            "{}, {}, {:.1} mm², {:.1} mm³, {}, {}, Euler number {}",
            count_as(self.vertices, "vertex", "vertices"),
            count(self.triangles, "triangle"),
            self.area_mm2,
            number(self.volume_mm3),
            count(self.components, "component"),
            count(self.boundary_edges, "boundary edge"),
            self.euler
        )
    }
}

/// A body shape, and its distance from the skin of the scan.
#[derive(Debug, Serialize)]
struct Variant {
    #[serde(flatten)]
    surface: Surface,
    volume_change_mm3: f64,
    least_shift_mm: f64,
    mean_shift_mm: f64,
    most_shift_mm: f64,
}

impl Variant {
    fn describe(&self) -> String {
        format!(
            "{}\nmoved by {:.2} to {:.2} mm, {:.2} on average; volume changed by {:.1} mm³",
            self.surface.describe(),
            number(self.least_shift_mm),
            number(self.most_shift_mm),
            number(self.mean_shift_mm),
            number(self.volume_change_mm3)
        )
    }
}

fn extract(args: &ExtractArgs, output: Output) -> anyhow::Result<()> {
    args.replace.outputs().file("--out", &args.out, MESH)?;
    let volume = args.scan.read()?.volume;
    let border = if args.close {
        Border::Closed
    } else {
        Border::Open
    };
    let watch = Stopwatch::start();
    let mesh = iso_surface(&volume, args.iso, border)?;
    let seconds = watch.read();
    write_mesh_file(&args.out, &mesh)?;
    output.print(&Surface::of(&mesh, seconds), Surface::describe)
}

fn augment(args: &AugmentArgs, output: Output) -> anyhow::Result<()> {
    args.replace.outputs().file("--out", &args.out, MESH)?;
    let case = Case::read(&args.case)?;
    let prepared = prepared(&case, &args.case)?;
    let mut settings = ShapeSettings::default();
    settings.offset_mm = args.offset_mm.unwrap_or(settings.offset_mm);
    anyhow::ensure!(
        settings.offset_mm > 0.0 && settings.offset_mm < 100.0,
        "--offset-mm is {}, expected a length above 0 and below 100 mm",
        settings.offset_mm
    );
    let limb = LimbId {
        patient: 0,
        side: case.side,
    };
    let watch = Stopwatch::start();
    let mesh = body_shape(
        &prepared.limb.mesh,
        &prepared.landmarks,
        args.shape,
        &settings,
        limb,
        args.seed,
    )?;
    let mesh = match args.bumps[..] {
        [] => mesh,
        ref bumps => add_bumps(&mesh, bumps)?,
    };
    let seconds = watch.read();
    write_mesh_file(&args.out, &mesh)?;
    let displacement = Displacement::between(&prepared.limb.mesh, &mesh);
    let [least, mean, most] = displacement.least_mean_most_mm();
    let variant = Variant {
        surface: Surface::of(&mesh, seconds),
        volume_change_mm3: displacement.volume_mm3,
        least_shift_mm: least,
        mean_shift_mm: mean,
        most_shift_mm: most,
    };
    output.print(&variant, Variant::describe)
}

#[derive(Debug, Serialize)]
struct Clustering {
    clusters: usize,
    noise: usize,
    core_points: usize,
    sizes: Vec<usize>,
}

fn cluster(args: &ClusterArgs, output: Output) -> anyhow::Result<()> {
    anyhow::ensure!(
        args.eps_mm.is_finite() && args.eps_mm > 0.0,
        "--eps-mm is {}, expected a length above 0",
        args.eps_mm
    );
    anyhow::ensure!(
        args.min_points > 0,
        "--min-points is 0, expected at least 1"
    );
    let cloud = read_mesh_file(&args.cloud)?.cloud;
    let clusters = dbscan(&cloud.points, args.eps_mm, args.min_points);
    let clustering = Clustering {
        clusters: clusters.sizes.len(),
        noise: clusters.noise,
        core_points: clusters.core_points(),
        sizes: clusters.sizes,
    };
    output.print(&clustering, |c| {
        let sizes: Vec<_> = c.sizes.iter().map(ToString::to_string).collect();
        let of = match sizes.is_empty() {
            true => String::new(),
            false => format!(" of {} points", sizes.join(", ")),
        };
        let noise = count(c.noise, "point");
        format!("{}{of}; {noise} of noise", count(c.clusters, "cluster"))
    })
}
