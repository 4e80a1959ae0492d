//! `ppa ct phantom`: a CT of a limb whose true shape is known.

use std::path::PathBuf;

use anyhow::{Context, bail};
use clap::{Args, ValueEnum};
use ppa_core::text::number;
use ppa_ct::{Format, Info, Volume, write};
use ppa_phantom::{Limb, LowerLeg, Scanner, Side, TableTop, Truth};
use serde::Serialize;

use super::describe;
use crate::output::{Output, working};
use crate::output_files::ReplaceArgs;
use crate::side_name::SideName;

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum LimbName {
    /// Lower leg and foot: P01 to P17, or a random one by seed
    LowerLeg,
    /// Knee: one simple shape
    Knee,
}

#[derive(Debug, Args)]
#[command(after_long_help = "\
A phantom is made of shapes, not of a person: its dimensions are drawn around published means. P01 is an average \
man; the seventeen of the table spread their mortise angles from 10 to 29 degrees. The left limb of a phantom is the \
mirror image of the right one with every dimension off by about 1 %. In radiographs voxels of 0.8 mm show as fine \
stripes where bone slants across the beam, as in the metatarsals; with voxels of 0.5 mm these are less than half as strong.

  ppa ct phantom --out p01.nii.gz --table                 # that of the demo
  ppa ct phantom --name P07 --side l --out p07_l.nii.gz   # a left leg
  ppa ct phantom --seed 42 --noise-hu 15 --blur-mm 1 --out 42.nii.gz
  ppa prepare p01.nii.gz --side r --out p01.case.toml     # the next step

--json prints what a measurement should find under \"truth\": frame ct (LPS), mm and radians.")]
pub struct PhantomArgs {
    /// File to write: .nii, .nii.gz, .nrrd, .mha, .mhd, or a new folder for DICOM slices
    #[arg(long)]
    out: PathBuf,
    /// Built-in lower leg: P01 to P17 [default: P01]
    #[arg(long, conflicts_with = "seed")]
    name: Option<String>,
    /// Draw a random lower leg from this seed instead
    #[arg(long)]
    seed: Option<u64>,
    /// Side of the body
    #[arg(long, value_enum, default_value = "r")]
    side: SideName,
    /// Kind of limb
    #[arg(long, value_enum, default_value = "lower-leg")]
    limb: LimbName,
    /// Put a titanium plate with five screws on the fibula
    #[arg(long)]
    plate: bool,
    /// Also write the bone label of each voxel, 0 for none; formats as for --out, except DICOM
    #[arg(long, value_name = "FILE")]
    labels: Option<PathBuf>,
    /// Side of the cubic voxels in mm
    #[arg(long, default_value_t = 0.8)]
    spacing_mm: f64,
    /// Place the limb on a table top
    #[arg(long)]
    table: bool,
    /// Blur of a scanner: full width at half maximum in mm
    #[arg(long, value_name = "MM", default_value_t = 0.0)]
    blur_mm: f64,
    /// Noise of a scanner: standard deviation in HU
    #[arg(long, value_name = "HU", default_value_t = 0.0)]
    noise_hu: f64,
    /// Seed of the noise
    #[arg(long, default_value_t = 0)]
    noise_seed: u64,
    #[command(flatten)]
    replace: ReplaceArgs,
}

#[derive(Debug, Serialize)]
struct Made {
    #[serde(flatten)]
    info: Info,
    phantom: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    truth: Option<Truth>,
    /// Names of labels 1, 2, …
    #[serde(skip_serializing_if = "Vec::is_empty")]
    labels: Vec<&'static str>,
}

/// Refuses output names that would cause a missing or wrong file later.
fn check_outputs(args: &PhantomArgs) -> anyhow::Result<()> {
    let mut outputs = args.replace.outputs();
    outputs.volume("--out", &args.out)?;
    let Some(labels) = &args.labels else {
        return Ok(());
    };
    if Format::of_name(labels)? == Format::Dicom {
        let labels = labels.display();
        bail!(
            "--labels {labels} would be a DICOM CT in Hounsfield units, but labels are numbers of bones: write NIfTI, \
             NRRD or MetaImage"
        );
    }
    outputs.volume("--labels", labels)
}

pub fn run(args: &PhantomArgs, output: Output) -> anyhow::Result<()> {
    check_outputs(args)?;
    let working = working("voxelising the phantom");
    let (phantom, limb, truth) = limb(args)?;
    let table = if args.table {
        TableTop::Present
    } else {
        TableTop::Absent
    };
    let mut volume = limb
        .voxelise(args.spacing_mm, table)
        .context("cannot voxelise the phantom")?;
    if args.blur_mm != 0.0 || args.noise_hu != 0.0 {
        let scanner = Scanner {
            blur_fwhm_mm: args.blur_mm,
            noise_hu: args.noise_hu,
            seed: args.noise_seed,
        };
        volume = scanner.scan(&volume).context("cannot scan the phantom")?;
    }
    write(&args.out, &volume)?;
    let mut labels = Vec::new();
    if let Some(path) = &args.labels {
        let numbers = limb.bone_labels(volume.grid());
        let numbers = numbers.into_iter().map(f32::from).collect();
        write(path, &Volume::new(volume.grid().clone(), numbers)?)?;
        labels = limb.bone_names();
    }
    working.finish_and_clear();
    let made = Made {
        info: Info::of_volume(&volume),
        phantom,
        truth,
        labels,
    };
    output.print(&made, |made| {
        let mut lines = vec![format!("phantom    {}", made.phantom)];
        if let Some(truth) = &made.truth {
            let angle = truth.mortise_angle_rad.to_degrees();
            lines.push(format!(
                "mortise    {:.1} degrees of internal rotation",
                number(angle)
            ));
        }
        for (number, name) in (1..).zip(&made.labels) {
            lines.push(format!("label      {number} {name}"));
        }
        lines.push(describe(&made.info));
        lines.join("\n")
    })
}

/// Name of the limb, its shape, and its ground truth.
fn limb(args: &PhantomArgs) -> anyhow::Result<(String, Limb, Option<Truth>)> {
    let side = Side::from(args.side);
    if args.limb == LimbName::Knee {
        if args.plate || args.name.is_some() || args.seed.is_some() {
            bail!("--limb knee is a single shape: --name, --seed and --plate do not apply to it");
        }
        return Ok((format!("{side} knee"), Limb::knee(side), None));
    }
    let (name, mut leg) = match (args.seed, args.name.as_deref().unwrap_or("P01")) {
        (Some(seed), _) => (format!("seed {seed}"), LowerLeg::from_seed(seed, side)),
        (None, name) => (name.to_ascii_uppercase(), LowerLeg::family(name, side)?),
    };
    if args.plate {
        leg = leg.with_plate();
    }
    let truth = leg.truth();
    let name = format!("{name}, {side} lower leg");
    Ok((name, leg.into_limb(), Some(truth)))
}
