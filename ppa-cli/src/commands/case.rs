//! `ppa case`: checks of a case.

use std::path::PathBuf;

use anyhow::{Context, bail};
use clap::{Args, Subcommand};
use ppa_core::text::count;
use ppa_dataset::Finding;
use ppa_generate::{CaseCheck, Drift};
use ppa_report::{case_picture, write_picture};
use serde::Serialize;

use crate::commands::pictures::shown_name;
use crate::output::{Output, working};
use crate::output_files::{PICTURE, ReplaceArgs};

#[derive(Debug, Subcommand)]
pub enum CaseCommand {
    /// Recompute a case and report what has changed since it was written
    Check(CheckArgs),
}

#[derive(Debug, Args)]
pub struct CheckArgs {
    /// Case written by `ppa prepare`, edited or not
    case: PathBuf,
    /// Picture to check it with, PNG
    #[arg(long, value_name = "FILE")]
    picture: Option<PathBuf>,
    #[command(flatten)]
    replace: ReplaceArgs,
}

#[derive(Debug, Serialize)]
struct Checked {
    /// Whether the case can be used: no severe finding is open.
    usable: bool,
    joint_mm: [f64; 3],
    axis: [f64; 3],
    findings: Vec<Finding>,
    /// Changes since the case was written; null if the file has no landmarks to compare.
    changed: Option<Drift>,
}

pub fn run(command: &CaseCommand, output: Output) -> anyhow::Result<()> {
    match command {
        CaseCommand::Check(args) => check(args, output),
    }
}

fn check(args: &CheckArgs, output: Output) -> anyhow::Result<()> {
    let mut outputs = args.replace.outputs();
    outputs.optional("--picture", args.picture.as_ref(), PICTURE)?;
    let working = working("recomputing the case");
    let checked = CaseCheck::of(&args.case)
        .with_context(|| format!("{} cannot be used", args.case.display()))?;
    if let Some(path) = &args.picture {
        let name = shown_name(&args.case);
        let drawn = case_picture(&name, &checked.limb, &checked.case.acknowledged);
        write_picture(path, &drawn)?;
    }
    working.finish_and_clear();
    let open: Vec<&Finding> = checked.open().collect();
    let landmarks = &checked.limb.landmarks;
    let checked = Checked {
        usable: open.is_empty(),
        joint_mm: landmarks.joint_centre,
        axis: landmarks.axis_direction,
        findings: checked.limb.findings.clone(),
        changed: checked.drift,
    };
    output.print(&checked, describe)?;
    if !open.is_empty() {
        bail!(
            "{} has {}: change the case or, after a review, list the code in `acknowledged`",
            args.case.display(),
            count(open.len(), "severe finding")
        );
    }
    Ok(())
}

fn describe(checked: &Checked) -> String {
    let [x, y, z] = checked.joint_mm;
    let [dx, dy, dz] = checked.axis;
    let mut lines = vec![
        "scan       unchanged since the case was written".to_owned(),
        format!("joint      {x:.1} {y:.1} {z:.1} mm (LPS)"),
        format!("axis       {dx:.4} {dy:.4} {dz:.4}"),
        format!("changed    {}", changes(checked.changed.as_ref())),
    ];
    lines.extend(checked.findings.iter().map(|finding| {
        format!(
            "{:10} [{}] {}",
            finding.severity, finding.code, finding.text
        )
    }));
    lines.join("\n")
}

fn changes(drift: Option<&Drift>) -> String {
    let Some(drift) = drift else {
        return "unknown: the file contains no landmarks that can be compared".to_owned();
    };
    if drift.is_none() {
        return "nothing since the case was written".to_owned();
    }
    let other = if drift.other_limb {
        "another side or kind of limb; "
    } else {
        ""
    };
    format!(
        "{other}since the case was written: joint by {:.1} mm, axis by {:.2} degrees, front by {:.2} degrees, plane by {:.2} degrees",
        drift.joint_mm, drift.axis_deg, drift.anterior_deg, drift.plane_deg
    )
}
