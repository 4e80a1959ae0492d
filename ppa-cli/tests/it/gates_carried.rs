//! Findings carried from the case to the training: repeated until they are acknowledged.

use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::{QUICK_XRAY, contains, fail, ppa, succeed, training};

const OPEN: &str = "severe [side-mismatch] limb l of patient 0";

/// Runs `ppa`, expects success, and returns stdout and stderr.
fn both(folder: &Path, arguments: &str) -> (String, String) {
    let output = ppa(folder, arguments).output().unwrap();
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "ppa {arguments}: {stderr}");
    (String::from_utf8(output.stdout).unwrap(), stderr)
}

/// Writes a plan of two poses of a right leg that is declared to be a left one.
fn write_wrong_side(folder: &Path) -> String {
    succeed(
        folder,
        "ct phantom --name P07 --spacing-mm 2 --table --out leg.nii",
    );
    let said = succeed(folder, "prepare leg.nii --side l --out leg.toml");
    let plan = format!(
        "version = 1\n[[case]]\nfile = \"leg.toml\"\npatient = 0\n\
         [rotation]\nfrom_deg = 0.0\nto_deg = 2.5\nstep_deg = 2.5\n{QUICK_XRAY}"
    );
    fs::write(folder.join("plan.toml"), plan).unwrap();
    said
}

fn acknowledge(folder: &Path, codes: &str) {
    let case = folder.join("leg.toml");
    let text = fs::read_to_string(&case).unwrap();
    let text = text.replacen("side = ", &format!("acknowledged = [{codes}]\nside = "), 1);
    fs::write(case, text).unwrap();
}

#[test]
fn a_severe_finding_is_repeated_until_it_is_acknowledged() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let said = write_wrong_side(folder);
    contains(
        &said,
        &[
            "severe     [side-mismatch]",
            "acknowledged = [\"side-mismatch\"]",
        ],
    );
    for command in [
        "plan plan.toml",
        "generate plan.toml --out data",
        "verify data --plan plan.toml",
        "label export data --out for_readers",
    ] {
        let (_, said) = both(folder, command);
        assert_eq!(said.matches(OPEN).count(), 1, "{command}: {said}");
        contains(&said, &["acknowledge it in the case once you have looked"]);
    }
    let status = succeed(folder, "status data");
    contains(&status, &["of which severe and not acknowledged: 1"]);
    for command in [
        "scene place leg.toml",
        "depth render leg.toml --out depth.png",
    ] {
        let (_, said) = both(folder, command);
        contains(&said, &["severe [side-mismatch] limb l of leg.toml"]);
    }
    // The case has no bones to label with.
    let output = ppa(folder, "label auto data --plan plan.toml")
        .output()
        .unwrap();
    assert!(!output.status.success());
    let said = String::from_utf8(output.stderr).unwrap();
    contains(&said, &[OPEN, "does not specify bones"]);

    acknowledge(folder, "\"side-mismatch\"");
    let (made, said) = both(folder, "generate plan.toml --out data --json");
    let made: Value = serde_json::from_str(&made).unwrap();
    assert_eq!(made["made"], 0);
    assert_eq!(made["findings"][0]["code"], "side-mismatch");
    assert_eq!(made["findings"][0]["acknowledged"], true);
    assert!(!said.contains(OPEN), "{said}");
    let listed = fs::read_to_string(folder.join("data/findings.json")).unwrap();
    contains(&listed, &["\"acknowledged\": true", "side-mismatch"]);
    for command in [
        "plan plan.toml",
        "verify data --plan plan.toml",
        "scene place leg.toml",
    ] {
        let (_, said) = both(folder, command);
        assert!(!said.contains("severe"), "{command}: {said}");
    }
}

#[test]
fn findings_of_poses_are_repeated_once_in_every_run() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    succeed(folder, "ct phantom --spacing-mm 2 --out leg.nii");
    // Without the forefoot.
    succeed(
        folder,
        "ct convert --crop 0,73,80,145,0,179 leg.nii cut.nii",
    );
    succeed(folder, "prepare cut.nii --side r --out leg.toml");
    let xray = QUICK_XRAY.replacen("[xray]", "[xray]\nmax_cut_share = 0.9", 1);
    let plan = format!(
        "version = 1\n[[case]]\nfile = \"leg.toml\"\npatient = 0\n\
         [rotation]\nto_deg = 0.0\n[shapes]\nvariants = [\"orig\"]\n\
         [depth]\nmax_cut_share = 0.9\n{xray}"
    );
    fs::write(folder.join("plan.toml"), plan).unwrap();
    for made in [1, 0] {
        let (summary, said) = both(folder, "generate plan.toml --out data");
        contains(&summary, &[&format!("{made} of them made now")]);
        let open = "severe [cut-in-region] limb r of patient 0";
        assert_eq!(said.matches(open).count(), 1, "{said}");
    }
}

#[test]
fn an_edited_case_gets_new_findings() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    write_wrong_side(folder);
    let case = folder.join("leg.toml");
    let text = fs::read_to_string(&case).unwrap();
    fs::write(case, text.replacen("side = \"l\"", "side = \"r\"", 1)).unwrap();
    let (_, said) = both(folder, "scene place leg.toml");
    assert!(!said.contains("severe"), "{said}");
}

#[test]
fn an_unknown_code_is_refused_with_the_known_ones() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    write_wrong_side(folder);
    acknowledge(folder, "\"wrong-side\"");
    let output = ppa(folder, "scene place leg.toml").output().unwrap();
    assert!(!output.status.success());
    let said = String::from_utf8(output.stderr).unwrap();
    contains(
        &said,
        &["leg.toml", "wrong-side", "side-mismatch", "limb-too-small"],
    );
}

/// Training reads `findings.json` of its datasets.
#[test]
fn training_and_evaluation_repeat_findings_of_their_data() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    training::write_data(folder);
    let findings = r#"[{"patient": 0, "side": "l", "acknowledged": false, "code": "side-mismatch", "severity": "severe",
        "text": "the fibula lies medially"}]"#;
    fs::write(folder.join("data/findings.json"), findings).unwrap();
    for command in ["train train.toml --out run", "eval run"] {
        let (_, said) = both(folder, command);
        assert_eq!(said.matches(OPEN).count(), 1, "{command}: {said}");
    }
    fs::write(folder.join("data/findings.json"), "[{").unwrap();
    contains(&fail(folder, "eval run --replace"), &["findings.json"]);
}
