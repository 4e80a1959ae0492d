//! Cases that a person edits, checks and views, and plans that start from them.

use std::fs;
use std::path::Path;

use ppa_dataset::FindingCode;
use ppa_generate::{Case, Plan, PlanCase, PreparedLimb};
use serde_json::Value;

use crate::{contains, fail, names, phantom, succeed};

/// Copies the case of the coarse phantom and its scan into `folder`.
fn own_case(folder: &Path) {
    fs::copy(phantom().join("p01.nii"), folder.join("p01.nii")).unwrap();
    let prepare = "prepare p01.nii --side r --no-picture --out leg.case.toml";
    succeed(folder, prepare);
}

/// Keys of `[choices]` that a case contains as comments with the values found, except the points of the plane.
const CHOICES: [&str; 7] = [
    "limb",
    "joint_centre",
    "joint_region",
    "calf_region",
    "axis_source",
    "axis",
    "anterior",
];

fn edit(folder: &Path, from: &str, to: &str) {
    let path = folder.join("leg.case.toml");
    let text = fs::read_to_string(&path).unwrap();
    assert!(text.contains(from), "{from:?} is missing in {text}");
    fs::write(path, text.replacen(from, to, 1)).unwrap();
}

/// Uncomments the line of a key and returns it.
fn switch_on(folder: &Path, key: &str) -> String {
    let text = fs::read_to_string(folder.join("leg.case.toml")).unwrap();
    let begin = format!("#{key} = ");
    let line = text.lines().find(|line| line.starts_with(&begin));
    let line = line.unwrap_or_else(|| panic!("{key} is missing in {text}"));
    edit(folder, line, &line[1..]);
    line[1..].to_owned()
}

#[test]
fn kept_bodies_are_named_in_the_case() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    own_case(folder);
    let case = |name: &str| Case::read(&folder.join(name)).unwrap();
    let leg = case("leg.case.toml");
    let text = fs::read_to_string(folder.join("leg.case.toml")).unwrap();
    assert!(
        leg.surface.kept.is_empty() && !text.contains("kept"),
        "{text}"
    );
    // A point of the limb itself is recorded and changes nothing else.
    let [x, y, z] = PreparedLimb::of_case(&leg).unwrap().landmarks.joint_centre;
    let prepare = "prepare p01.nii --side r --no-picture";
    let keep = format!("{prepare} --keep={x},{y},{z} --out kept.case.toml");
    succeed(folder, &keep);
    let kept = case("kept.case.toml");
    assert_eq!(kept.surface.kept, [[x, y, z]]);
    let limb = |case: &Case| PreparedLimb::of_case(case).unwrap().limb;
    assert_eq!(limb(&kept), limb(&leg));
    let said = fail(
        folder,
        &format!("{prepare} --keep=0,0,9000 --out air.case.toml"),
    );
    contains(&said, &["(0, 0, 9000) mm", "is not in solid tissue"]);
}

#[test]
fn a_removed_ball_is_named_in_the_case() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    own_case(folder);
    let case = |name: &str| Case::read(&folder.join(name)).unwrap();
    let leg = PreparedLimb::of_case(&case("leg.case.toml")).unwrap();
    // The tip of the foot: the vertex farthest to the front.
    let vertices = leg.limb.mesh.vertices.iter();
    let tip = vertices.min_by(|a, b| a.y.total_cmp(&b.y)).unwrap();
    let [x, y, z] = [tip.x, tip.y, tip.z].map(|c| c.round());
    let prepare = "prepare p01.nii --side r --no-picture";
    succeed(
        folder,
        &format!("{prepare} --remove={x},{y},{z},12 --out cut.case.toml"),
    );
    let cut = case("cut.case.toml");
    assert_eq!(cut.surface.removed.len(), 1);
    let ball = cut.surface.removed[0];
    let expected = [x, y, z].map(f64::from);
    assert_eq!((ball.centre_mm, ball.radius_mm), (expected, 12.0));
    let found = PreparedLimb::of_case(&cut).unwrap();
    let finding = found.findings.iter();
    let finding = finding.filter(|f| f.code == FindingCode::PartRemoved);
    let values: Vec<f64> = finding.filter_map(|finding| finding.value).collect();
    assert_eq!(values, [found.limb.report.removed_mm3]);
    assert!(values[0] > 100.0, "{values:?}");
    assert!(found.limb.report.limb_voxels < leg.limb.report.limb_voxels);
    let said = fail(
        folder,
        &format!("{prepare} --remove={x},{y},{z},0 --out none.case.toml"),
    );
    contains(&said, &["removed[].radius_mm is 0", "positive"]);
}

#[test]
fn a_picture_lies_beside_the_case_and_replaces_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    own_case(folder);
    assert_eq!(names(folder), ["leg.case.toml", "p01.nii"]);
    let prepare = "prepare p01.nii --side r --out other.case.toml";
    succeed(folder, prepare);
    let picture = image::open(folder.join("other.case.png")).unwrap();
    assert!(picture.width() >= 1600 && picture.height() >= 1000);
    fs::write(folder.join("mine.png"), "mine").unwrap();
    for (picture, part) in [("mine.png", "mine.png exists"), ("a.jpg", "ends in .png")] {
        let said = fail(
            folder,
            &format!("prepare p01.nii --side r --out new.toml --picture {picture}"),
        );
        assert!(said.contains(part), "{said}");
    }
    assert_eq!(fs::read(folder.join("mine.png")).unwrap(), b"mine");
    assert!(!folder.join("new.toml").exists());
    let place = "scene place leg.case.toml --angle 18 --picture pose.png";
    succeed(folder, place);
    assert!(image::open(folder.join("pose.png")).unwrap().width() >= 1600);
    assert!(fail(folder, place).contains("pose.png exists"));
    let check = "case check leg.case.toml --picture check.png";
    succeed(folder, check);
    assert!(folder.join("check.png").exists());
}

#[test]
fn only_what_was_chosen_stands_in_the_choices() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    own_case(folder);
    let text = fs::read_to_string(folder.join("leg.case.toml")).unwrap();
    let choices = |text: &str| {
        let table: toml::Table = toml::from_str(text).unwrap();
        table["choices"].as_table().unwrap().clone()
    };
    assert!(choices(&text).is_empty(), "{text}");
    for key in CHOICES.into_iter().chain(["plane_points"]) {
        assert!(text.contains(&format!("\n#{key} = ")), "{key}: {text}");
    }
    let axis = "prepare p01.nii --side r --no-picture --out axis.case.toml --axis -92,14,-310 -91,10,-150 --joint -92,14,-300";
    succeed(folder, axis);
    let text = fs::read_to_string(folder.join("axis.case.toml")).unwrap();
    let chosen = choices(&text);
    assert_eq!(chosen.keys().collect::<Vec<_>>(), ["axis", "joint_centre"]);
    assert!(
        !text.contains("#joint_region") && !text.contains("#axis"),
        "{text}"
    );
    let both = "prepare p01.nii --side r --out no.toml --axis 0,0,-10 1,2,180 --joint-region 20,40";
    let output = crate::ppa(folder, both).output().unwrap();
    assert!(!output.status.success());
    contains(
        &String::from_utf8_lossy(&output.stderr),
        &["--axis", "--joint-region"],
    );
}

/// A case with any single key chosen can be used; with the value that was found nothing changes.
#[test]
fn any_key_of_the_choices_can_be_chosen_alone() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    own_case(folder);
    let untouched = fs::read(folder.join("leg.case.toml")).unwrap();
    let check = || -> Value {
        serde_json::from_str(&succeed(folder, "case check leg.case.toml --json")).unwrap()
    };
    let shift = |changed: &Value, key: &str| changed["changed"][key].as_f64().unwrap();
    for key in CHOICES {
        fs::write(folder.join("leg.case.toml"), &untouched).unwrap();
        switch_on(folder, key);
        let checked = check();
        for measure in ["joint_mm", "axis_deg", "anterior_deg", "plane_deg"] {
            assert!(shift(&checked, measure) < 1e-3, "{key}: {checked}");
        }
        assert_eq!(checked["changed"]["other_limb"], false);
    }
    for (from, to, measure, least) in [
        (
            "#axis_source = \"bone\"",
            "axis_source = \"limb\"",
            "axis_deg",
            0.1,
        ),
        (
            "#limb = \"lower_leg\"",
            "limb = \"other\"",
            "joint_mm",
            20.0,
        ),
    ] {
        fs::write(folder.join("leg.case.toml"), &untouched).unwrap();
        edit(folder, from, to);
        edit(
            folder,
            "version = 1\n",
            "version = 1\nacknowledged = [\"no-joint\", \"axis-off-shaft\"]\n",
        );
        let checked = check();
        assert!(shift(&checked, measure) > least, "{checked}");
        succeed(folder, "scene place leg.case.toml --angle 10");
    }
    fs::write(folder.join("leg.case.toml"), &untouched).unwrap();
    let front = switch_on(folder, "anterior");
    edit(folder, &front, "anterior = [0.5, -1.0, 0.0]");
    let checked = check();
    assert!(
        (shift(&checked, "anterior_deg") - 26.565).abs() < 1.0,
        "{checked}"
    );
    assert!(shift(&checked, "axis_deg") < 1e-3, "{checked}");
    fs::write(folder.join("leg.case.toml"), &untouched).unwrap();
    edit(
        folder,
        "side = \"r\"",
        "side = \"l\"\nacknowledged = [\"side-mismatch\"]",
    );
    assert_eq!(check()["changed"]["other_limb"], true);
}

/// Old cases, with all choices filled in.
#[test]
fn a_case_with_all_choices_is_read_as_it_was() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    own_case(folder);
    for key in CHOICES.iter().filter(|&&key| key != "axis") {
        switch_on(folder, key);
    }
    let said = succeed(folder, "case check leg.case.toml");
    contains(
        &said,
        &["unchanged since the case was written", "nothing since"],
    );
}

#[test]
fn a_case_that_cannot_be_used_fails_its_check() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    own_case(folder);
    succeed(folder, "case check leg.case.toml");
    let untouched = fs::read(folder.join("leg.case.toml")).unwrap();
    edit(
        folder,
        "[choices]\n",
        "[choices]\nanterior = [0.0, 0.0, 1.0]\n",
    );
    let said = fail(folder, "case check leg.case.toml");
    contains(&said, &["leg.case.toml cannot be used", "anterior"]);
    fs::write(folder.join("leg.case.toml"), &untouched).unwrap();
    succeed(
        folder,
        "ct phantom --out p01.nii --spacing-mm 2 --name P02 --replace",
    );
    let said = fail(folder, "case check leg.case.toml");
    contains(&said, &["is not the scan this case was made from"]);
}

#[test]
fn a_plan_begins_with_all_defaults() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    own_case(folder);
    fs::copy(folder.join("leg.case.toml"), folder.join("again.case.toml")).unwrap();
    fs::create_dir(folder.join("plans")).unwrap();
    let init = "plan init leg.case.toml again.case.toml --out plans/plan.toml";
    contains(&succeed(folder, init), &["plans/plan.toml", "2 limbs"]);
    let path = folder.join("plans/plan.toml");
    let case = |name: &str| PlanCase {
        file: folder.join("plans").join("..").join(name),
        patient: 0,
    };
    let expected = Plan::new(vec![case("leg.case.toml"), case("again.case.toml")]);
    assert_eq!(Plan::read(&path).unwrap(), expected);
    let text = fs::read_to_string(&path).unwrap();
    contains(
        &text,
        &[
            "#room_file",
            "#[depth.sensor]",
            "kvp = 60.0    # tube voltage",
        ],
    );
    assert!(fail(folder, init).contains("plans/plan.toml exists"));
    let missing = "plan init none.case.toml --out other.toml";
    assert!(fail(folder, missing).contains("none.case.toml"));
    assert!(!folder.join("other.toml").exists());
}
