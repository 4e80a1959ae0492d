//! `ppa prepare`: finds skin, axis and plane of a limb and writes them as a case.

use std::path::PathBuf;

use anyhow::Context;
use clap::{Args, ValueEnum};
use ppa_core::text::number;
use ppa_ct::write;
use ppa_dataset::Severity;
use ppa_dataset::labels::{BoneFile, BoneNumbers};
use ppa_generate::{Case, Found, prepare};
use ppa_label::{check_bones, check_segmented_name, segment_checked_bones};
use ppa_mesh::{Ball, LimbSettings, VoxelBox, write_mesh_file};
use ppa_report::{case_picture, write_picture};
use ppa_scene::{AxisSource, LandmarkOverrides, LimbKind, Side};

use crate::commands::pictures::shown_name;
use crate::interrupt::{NOTHING_WRITTEN, ends_at_once};
use crate::number_lists::{ball, bone_numbers, point, range, voxel_box};
use crate::output::{Output, working};
use crate::output_files::{MESH, NUMBERS, PICTURE, ReplaceArgs};
use crate::scan_args::ScanArgs;
use crate::side_name::SideName;

#[derive(Debug, Clone, Copy, ValueEnum)]
enum LimbName {
    /// Lower leg with its ankle
    LowerLeg,
    /// Knee with parts of thigh or lower leg
    Knee,
    /// Any other limb, rotated about its axis at the middle of its length
    Other,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum AxisName {
    /// The tibia: swelling does not shift the axis off the joint
    Bone,
    /// The whole cross-section inside the skin
    Limb,
}

#[derive(Debug, Args)]
pub struct PrepareArgs {
    #[command(flatten)]
    scan: ScanArgs,
    /// Side of the limb; if the scan shows two side by side, the one on this side of the patient is used
    #[arg(long, value_enum)]
    side: SideName,
    /// Case file to write
    #[arg(long)]
    out: PathBuf,
    /// Save the skin, ct frame: .ply, .obj or .stl
    #[arg(long)]
    ply: Option<PathBuf>,
    /// Kind of limb [default: lower-leg where an ankle is found, else knee where one is]
    #[arg(long, value_enum)]
    limb: Option<LimbName>,
    /// Hounsfield units of the skin [default: -500]
    #[arg(long, value_name = "HU", allow_negative_numbers = true)]
    iso_hu: Option<f64>,
    /// Keep only this box of voxels: first and one past the last index along i, j and k
    #[arg(long, value_name = "I,I,J,J,K,K", value_parser = voxel_box)]
    crop: Option<VoxelBox>,
    /// A point inside the wanted limb when the scan shows several, ct frame
    #[arg(long, value_name = "X,Y,Z", value_parser = point, allow_hyphen_values = true)]
    inside: Option<[f64; 3]>,
    /// A point inside another body to keep as part of the limb, ct frame; may be given several times
    #[arg(long, value_name = "X,Y,Z", value_parser = point, allow_hyphen_values = true)]
    keep: Vec<[f64; 3]>,
    /// Remove a ball from the limb: centre and radius, ct frame, mm; may be given several times
    #[arg(long, value_name = "X,Y,Z,RADIUS", value_parser = ball, allow_hyphen_values = true)]
    remove: Vec<Ball>,
    /// Centre of the joint, ct frame
    #[arg(long, value_name = "X,Y,Z", value_parser = point, allow_hyphen_values = true)]
    joint: Option<[f64; 3]>,
    /// Which centres in the two regions define the axis: those of the bone or of the whole limb
    #[arg(long, value_enum)]
    axis_source: Option<AxisName>,
    /// Region just proximal to the joint: from and to, mm proximal to the joint
    #[arg(long, value_name = "FROM,TO", value_parser = range, allow_hyphen_values = true)]
    joint_region: Option<[f64; 2]>,
    /// Region around the calf: from and to, mm proximal to the joint
    #[arg(long, value_name = "FROM,TO", value_parser = range, allow_hyphen_values = true)]
    calf_region: Option<[f64; 2]>,
    /// Two points that the axis runs through, ct frame, instead of the centres of two regions
    #[arg(
        long,
        num_args = 2,
        value_names = ["X,Y,Z", "X,Y,Z"],
        value_parser = point,
        allow_hyphen_values = true,
        conflicts_with_all = ["axis_source", "joint_region", "calf_region"]
    )]
    axis: Option<Vec<[f64; 3]>>,
    /// Direction that faces up at angle 0, ct frame
    #[arg(long, value_name = "X,Y,Z", value_parser = point, allow_hyphen_values = true)]
    anterior: Option<[f64; 3]>,
    /// A point of the plane under the limb, ct frame; give three: one distal, two proximal
    #[arg(long = "plane-point", value_name = "X,Y,Z", value_parser = point, allow_hyphen_values = true)]
    plane_points: Vec<[f64; 3]>,
    /// Picture to check the case with, PNG: slices and skin with axis, joint, plane and cuts [default: next to the case]
    #[arg(long, value_name = "FILE")]
    picture: Option<PathBuf>,
    /// Draw no picture
    #[arg(long, conflicts_with = "picture")]
    no_picture: bool,
    /// Bone label of each voxel, for `ppa label auto`: NIfTI, NRRD or MetaImage in the scan's frame
    #[arg(long, value_name = "FILE")]
    bones: Option<PathBuf>,
    /// Segment tibia, fibula, talus and neighbouring bones for `ppa label auto`, and write the label volume: NIfTI, NRRD or MetaImage.
    /// Fails where bones touch, and names the place
    #[arg(long, value_name = "FILE", conflicts_with = "bones")]
    segment_bones: Option<PathBuf>,
    /// Labels of tibia, fibula and talus in --bones
    #[arg(long, value_name = "TIBIA,FIBULA,TALUS", default_value = "3,4,1", requires = "bones", value_parser = bone_numbers)]
    bone_numbers: BoneNumbers,
    #[command(flatten)]
    replace: ReplaceArgs,
}

pub fn run(args: &PrepareArgs, output: Output) -> anyhow::Result<()> {
    let plane_points = match args.plane_points[..] {
        [] => None,
        [a, b, c] => Some([a, b, c]),
        _ => anyhow::bail!(
            "--plane-point was given {} times, expected 3",
            args.plane_points.len()
        ),
    };
    let mut outputs = args.replace.outputs();
    if let Some(bones) = &args.segment_bones {
        check_segmented_name(bones, &args.scan.path).context("--segment-bones")?;
        outputs.file("--segment-bones", bones, NUMBERS)?;
    }
    outputs.file_in_new_folder("--out", &args.out, &[".toml"])?;
    outputs.optional("--ply", args.ply.as_ref(), MESH)?;
    let picture = match (&args.picture, args.no_picture) {
        (_, true) => None,
        (Some(path), _) => {
            outputs.file("--picture", path, PICTURE)?;
            Some(path.clone())
        }
        (None, _) => {
            let path = args.out.with_extension("png");
            outputs.file_in_new_folder("the picture next to the case,", &path, PICTURE)?;
            Some(path)
        }
    };
    let mut surface = LimbSettings {
        inside: args.inside,
        kept: args.keep.clone(),
        removed: args.remove.clone(),
        crop: args.crop,
        ..LimbSettings::default()
    };
    surface.iso_hu = args.iso_hu.unwrap_or(surface.iso_hu);
    let choices = LandmarkOverrides {
        limb: args.limb.map(|limb| match limb {
            LimbName::LowerLeg => LimbKind::LowerLeg,
            LimbName::Knee => LimbKind::Knee,
            LimbName::Other => LimbKind::Other,
        }),
        joint_centre: args.joint,
        joint_region: args.joint_region,
        calf_region: args.calf_region,
        anterior: args.anterior,
        plane_points,
        axis_source: args.axis_source.map(|source| match source {
            AxisName::Bone => AxisSource::Bone,
            AxisName::Limb => AxisSource::Limb,
        }),
        axis: args.axis.as_ref().map(|points| [points[0], points[1]]),
    };
    let side = Side::from(args.side);
    let stoppable = ends_at_once(NOTHING_WRITTEN)?;
    let working = working("finding the limb");
    let (mut case, prepared) = prepare(
        &args.scan.path,
        &args.scan.options(),
        side,
        &surface,
        &choices,
    )?;
    if let Some(path) = &args.bones {
        let bones = BoneFile {
            path: path.clone(),
            numbers: args.bone_numbers,
            segmented: false,
        };
        check_bones(&bones, &prepared.landmarks)?;
        case.bones = Some(bones);
    }
    let segmented = match &args.segment_bones {
        Some(path) => {
            let (limb, landmarks) = (&prepared.limb.mask, &prepared.landmarks);
            let bones = segment_checked_bones(&prepared.volume, limb, landmarks)?;
            Some((path, bones))
        }
        None => None,
    };
    drop(stoppable);
    if let Some((path, bones)) = segmented {
        write(path, &bones)?;
        case.bones = Some(BoneFile {
            path: path.clone(),
            numbers: BoneNumbers::default(),
            segmented: true,
        });
    }
    if let Some(ply) = &args.ply {
        write_mesh_file(ply, &prepared.limb.mesh)?;
    }
    case.write(&args.out)?;
    if let Some(path) = &picture {
        let drawn = case_picture(&shown_name(&args.out), &prepared, &case.acknowledged);
        write_picture(path, &drawn)?;
    }
    working.finish_and_clear();
    output.print(&case, |case| describe(case, args))
}

fn describe(case: &Case, args: &PrepareArgs) -> String {
    let mut lines = vec![format!("case       {}", args.out.display())];
    lines.extend(case.found.iter().flat_map(describe_found));
    lines.join("\n")
}

fn describe_found(found: &Found) -> Vec<String> {
    let landmarks = &found.landmarks;
    let [x, y, z] = landmarks.joint_centre;
    let [dx, dy, dz] = landmarks.axis_direction;
    let mut lines = vec![
        format!(
            "joint      {:.1} {:.1} {:.1} mm (LPS)",
            number(x),
            number(y),
            number(z)
        ),
        format!(
            "axis       {:.4} {:.4} {:.4}",
            number(dx),
            number(dy),
            number(dz)
        ),
    ];
    for [x, y, z] in landmarks.plane_points {
        let [x, y, z] = [x, y, z].map(number);
        lines.push(format!("plane      {x:.1} {y:.1} {z:.1} mm"));
    }
    lines.extend(found.findings.iter().map(|finding| {
        format!(
            "{:10} [{}] {}",
            finding.severity, finding.code, finding.text
        )
    }));
    let mut severe: Vec<String> = found
        .findings
        .iter()
        .filter(|finding| finding.severity == Severity::Severe)
        .map(|finding| format!("\"{}\"", finding.code))
        .collect();
    severe.dedup();
    if !severe.is_empty() {
        lines.push(format!(
            "Later commands repeat severe findings; once you have reviewed them, add to the case: acknowledged = [{}]",
            severe.join(", ")
        ));
    }
    lines
}
