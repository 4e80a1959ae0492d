//! Command lines, to be copied, that do the same as the page.

use std::fmt::Write;
use std::path::Path;

use ppa_cluster::shell_quoted;
use ppa_core::{Roi, Side};
use ppa_dataset::labels::{BoneFile, BoneNumbers};
use ppa_generate::Case;
use ppa_scene::{AxisSource, LandmarkOverrides, LimbKind};
use serde::Serialize;

use crate::dose;
use crate::live::Watch;
use crate::network::Networks;
use crate::what_if::WhatIf;

/// Commands for a state of the page.
#[derive(Debug, Serialize)]
pub(crate) struct Commands {
    /// Makes the case with the decisions so far.
    pub prepare: String,
}

/// Commands for the sliders.
#[derive(Debug, Serialize)]
pub(crate) struct ImageCommands {
    pub depth: String,
    pub radiograph: String,
    pub dose: String,
    pub coverage: String,
    /// Whether the plan that they read must be saved first, because no option can make its changes.
    pub need_saved_plan: bool,
}

/// Commands that make the dataset of a plan.
#[derive(Debug, Serialize)]
pub(crate) struct PlanCommands {
    pub forecast: String,
    pub generate: String,
    pub status: String,
}

/// Returns the commands that make the dataset of a plan file.
pub(crate) fn of_plan(plan: &Path, dataset: &Path) -> PlanCommands {
    let (plan, dataset) = (quoted(plan), quoted(dataset));
    PlanCommands {
        forecast: format!("ppa plan {plan} --out {dataset}"),
        generate: format!("ppa generate {plan} --out {dataset}"),
        status: format!("ppa status {dataset}"),
    }
}

/// Commands that examine a dataset.
#[derive(Debug, Serialize)]
pub(crate) struct DatasetCommands {
    pub quality: String,
    pub check: String,
}

/// Returns the commands that examine a dataset.
pub(crate) fn of_dataset(dataset: &Path) -> DatasetCommands {
    let dataset = quoted(dataset);
    DatasetCommands {
        quality: format!("ppa qa {dataset}"),
        check: format!("ppa dataset check {dataset}"),
    }
}

/// Commands that process the grades of readers as the page does.
#[derive(Debug, Serialize)]
pub(crate) struct GradingCommands {
    pub import: String,
    pub agree: String,
}

/// Returns the commands for the grades in a folder for readers.
pub(crate) fn of_grading(dataset: &Path, sheets: &Path, key: &Path) -> GradingCommands {
    let grades = dataset.join("grades.csv");
    let (dataset, key) = (quoted(dataset), quoted(key));
    // The shell expands this to the files of all readers.
    let sheets = format!("{}/grades_*.csv", quoted(sheets));
    GradingCommands {
        import: format!("ppa label import {dataset} --key {key} {sheets}"),
        agree: format!("ppa label agree {}", quoted(&grades)),
    }
}

/// Returns the command that evaluates a training run.
pub(crate) fn of_training(run: &Path) -> String {
    format!("ppa eval {}", quoted(run))
}

/// Returns the command that predicts from the frames of a watched folder.
pub(crate) fn of_watch(networks: &Networks, watch: &Watch) -> String {
    let predict = predict(networks, watch.side, watch.regions);
    format!("{predict} --watch {}", quoted(&watch.folder))
}

/// Returns the command that predicts from the depth images written by the command of [`ImageCommands`].
pub(crate) fn of_prediction(networks: &Networks, side: Side, regions: [Roi; 2]) -> String {
    let predict = predict(networks, Some(side), regions);
    format!("printf 'depth_left.png\\tdepth_right.png\\n' | {predict} --stdin")
}

/// Returns `ppa predict` without its frames.
fn predict(networks: &Networks, side: Option<Side>, regions: [Roi; 2]) -> String {
    let mut line = format!("ppa predict {}", quoted(&networks.left));
    if let Some(right) = &networks.right {
        let _ = write!(line, " {}", quoted(right));
    }
    if let Some(side) = side {
        let _ = write!(line, " --side {}", side.letter());
    }
    for (flag, region) in ["--roi-left", "--roi-right"].iter().zip(regions) {
        let (x, y, size) = (region.x_start, region.y_start, region.size);
        let _ = write!(line, " {flag} {x},{y},{size}");
    }
    if let Some(confidence) = &networks.confidence {
        let _ = write!(line, " --confidence {}", quoted(confidence));
    }
    line
}

/// Returns the command that reproduces the decisions of a case.
pub(crate) fn of_case(case: &Case, out: &Path) -> Commands {
    let mut line = format!("ppa prepare {}", quoted(&case.source.path));
    let _ = write!(line, " --side {}", case.side.letter());
    if let Some(series) = case.source.series {
        let _ = write!(line, " --series {series}");
    }
    for (flag, given) in [
        ("--fill-gaps", case.source.fill_gaps),
        ("--force", case.source.force),
    ] {
        if given {
            let _ = write!(line, " {flag}");
        }
    }
    let surface = &case.surface;
    if surface.iso_hu != ppa_mesh::LimbSettings::default().iso_hu {
        let _ = write!(line, " --iso-hu {}", surface.iso_hu);
    }
    if let Some(crop) = surface.crop {
        let ends = (0..3).map(|axis| format!("{},{}", crop.low[axis], crop.high[axis]));
        let _ = write!(line, " --crop {}", ends.collect::<Vec<_>>().join(","));
    }
    if let Some(point) = surface.inside {
        let _ = write!(line, " --inside={}", list(&point));
    }
    for point in &surface.kept {
        let _ = write!(line, " --keep={}", list(point));
    }
    for ball in &surface.removed {
        let _ = write!(
            line,
            " --remove={},{}",
            list(&ball.centre_mm),
            ball.radius_mm
        );
    }
    line += &of_choices(&case.choices);
    if let Some(bones) = &case.bones {
        line += &of_bones(bones);
    }
    let _ = write!(line, " --out {}", quoted(out));
    Commands { prepare: line }
}

fn of_bones(bones: &BoneFile) -> String {
    let path = quoted(&bones.path);
    if bones.segmented {
        return format!(" --segment-bones {path}");
    }
    let mut line = format!(" --bones {path}");
    if bones.numbers != BoneNumbers::default() {
        let BoneNumbers {
            tibia,
            fibula,
            talus,
        } = bones.numbers;
        let _ = write!(line, " --bone-numbers {tibia},{fibula},{talus}");
    }
    line
}

fn of_choices(choices: &LandmarkOverrides) -> String {
    let mut line = String::new();
    if let Some(limb) = choices.limb {
        let name = match limb {
            LimbKind::LowerLeg => "lower-leg",
            LimbKind::Knee => "knee",
            LimbKind::Other => "other",
        };
        let _ = write!(line, " --limb {name}");
    }
    match choices.axis_source {
        Some(AxisSource::Bone) => line += " --axis-source bone",
        Some(AxisSource::Limb) => line += " --axis-source limb",
        // Two points given by --axis.
        Some(AxisSource::Given) | None => {}
    }
    let lists = [
        ("--joint", choices.joint_centre.as_ref().map(|p| &p[..])),
        (
            "--joint-region",
            choices.joint_region.as_ref().map(|p| &p[..]),
        ),
        (
            "--calf-region",
            choices.calf_region.as_ref().map(|p| &p[..]),
        ),
        ("--anterior", choices.anterior.as_ref().map(|p| &p[..])),
    ];
    for (flag, values) in lists {
        if let Some(values) = values {
            let _ = write!(line, " {flag}={}", list(values));
        }
    }
    if let Some([a, b]) = choices.axis {
        let _ = write!(line, " --axis {} {}", list(&a), list(&b));
    }
    for point in choices.plane_points.iter().flatten() {
        let _ = write!(line, " --plane-point={}", list(point));
    }
    line
}

/// Returns the commands for the page's images. `opened` is the opened plan, if any; `saved` is the path for a plan with the changes;
/// `seed` is that of the plan.
pub(crate) fn of_images(
    case: &Path,
    opened: Option<&Path>,
    saved: &Path,
    seed: u64,
    what_if: &WhatIf,
) -> ImageCommands {
    let need_saved_plan = what_if.needs_plan();
    let plan = if need_saved_plan { Some(saved) } else { opened };
    let plan = plan.map_or(String::new(), |plan| format!(" --plan {}", quoted(plan)));
    let pose = format!("{}{plan} --angle {}", quoted(case), what_if.angle_deg);
    let mut depth = format!("ppa depth render {pose}");
    if what_if.sensor && !need_saved_plan {
        depth += " --sensor default";
    }
    if what_if.sensor && seed != 0 {
        let _ = write!(depth, " --seed {seed}");
    }
    if let Some(shape) = what_if.shape {
        let _ = write!(depth, " --shape {}", shape.name());
    }
    depth += " --out depth.png";
    let mut exposure = format!("ppa xray simulate {pose}");
    let mut load = String::new();
    if !need_saved_plan {
        exposure += &of_beam(what_if);
        load = of_load(what_if);
    }
    if seed != 0 {
        let _ = write!(exposure, " --seed {seed}");
    }
    let radiograph = format!("{exposure}{load} --out radiograph.png");
    // Doses are per photon, independent of the tube load.
    let analog = format!("--engine analog --histories {}", dose::HISTORIES);
    let dose = format!("{exposure} {analog} --dose --out dose.png --json");
    ImageCommands {
        coverage: format!("ppa depth coverage {pose}"),
        depth,
        radiograph,
        dose,
        need_saved_plan,
    }
}

/// Returns the options for technique and beam.
fn of_beam(what_if: &WhatIf) -> String {
    let mut line = String::new();
    if let Some(technique) = &what_if.technique {
        let _ = write!(line, " --technique {}", shell_quoted(technique));
    }
    if let Some(kvp) = what_if.kvp {
        let _ = write!(line, " --kvp {kvp}");
    }
    for filter in what_if.filters.iter().flatten() {
        let _ = write!(line, " --filter {}", shell_quoted(filter));
    }
    line
}

fn of_load(what_if: &WhatIf) -> String {
    match (what_if.mas, what_if.exposure_index) {
        (Some(mas), _) => format!(" --mas {mas}"),
        (None, Some(index)) => format!(" --aec {index}"),
        (None, None) => String::new(),
    }
}

fn quoted(path: &Path) -> String {
    shell_quoted(&path.to_string_lossy())
}

fn list(values: &[f64]) -> String {
    let values = values.iter().map(f64::to_string);
    values.collect::<Vec<_>>().join(",")
}
