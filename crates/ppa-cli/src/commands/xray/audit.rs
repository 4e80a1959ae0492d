//! `ppa xray audit`: what a HU calibration makes of a CT or a limb.

use std::fmt::Write;
use std::path::PathBuf;

use anyhow::Context;
use clap::Args;
use ppa_dataset::{Case, PreparedLimb};
use ppa_xray::{Audit, HuCalibration};

use crate::output::{Output, working};

#[derive(Debug, Args)]
pub struct AuditArgs {
    /// CT (DICOM folder or file, or a volume in one file such as .nii.gz), or case written by `ppa prepare` (.toml): its limb alone
    path: PathBuf,
    /// HU calibration (TOML) in place of the built-in one
    #[arg(long, value_name = "FILE")]
    calibration: Option<PathBuf>,
}

pub fn run(args: &AuditArgs, output: Output) -> anyhow::Result<()> {
    let calibration = match &args.calibration {
        Some(path) => HuCalibration::read(path)?,
        None => HuCalibration::default(),
    };
    let working = working("reading the scan");
    let audit = if args.path.extension().is_some_and(|ending| ending == "toml") {
        let case = Case::read(&args.path)?;
        let prepared = PreparedLimb::of_case(&case)
            .with_context(|| format!("cannot prepare the limb of {}", args.path.display()))?;
        calibration.audit(&prepared.volume, Some(&prepared.limb.mask))?
    } else {
        calibration.audit(&ppa_ct::read(&args.path)?.volume, None)?
    };
    working.finish_and_clear();
    output.print(&audit, describe)
}

fn describe(audit: &Audit) -> String {
    let mut text = format!(
        "{:<20}{:>10}{:>13}{:>11}  {:>7} {:>7}\n",
        "segment", "voxels", "volume cm³", "mass g", "from HU", "to HU"
    );
    let mut line = |text_line: std::fmt::Arguments| {
        text.write_fmt(text_line)
            .expect("a String takes everything");
    };
    for segment in &audit.segments {
        let hu = |hu: Option<f32>| hu.map_or("-".to_owned(), |hu| format!("{hu:.0}"));
        line(format_args!(
            "{:<20}{:>10}{:>13.2}{:>11.2}  {:>7} {:>7}\n",
            segment.name,
            segment.voxels,
            segment.volume_cm3,
            segment.mass_g,
            hu(segment.lowest_hu),
            hu(segment.highest_hu)
        ));
        if segment.below_curve + segment.above_curve > 0 {
            line(format_args!(
                "  beyond its density curve: {} voxels below, {} above\n",
                segment.below_curve, segment.above_curve
            ));
        }
    }
    line(format_args!(
        "{:.2} g, {:.2} cm³ of metal, {} voxels outside the limb\n",
        audit.mass_g, audit.metal_cm3, audit.outside_mask
    ));
    line(format_args!(
        "lowest {:.0} HU in {} voxels, highest {:.0} HU in {}",
        audit.lowest_hu, audit.voxels_at_lowest, audit.highest_hu, audit.voxels_at_highest
    ));
    if audit.voxels_at_highest > 1 && audit.highest_hu >= 3_000.0 {
        line(format_args!(": clipped, metals look alike there"));
    }
    text
}
