//! `room.toml` and frames that any program can check.

use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::{fail, phantom, succeed};

type Rows = [[f64; 4]; 4];

fn frames(path: &Path) -> Value {
    serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap()
}

fn motion(frames: &Value, name: &str) -> Rows {
    serde_json::from_value(frames["motions"][name].clone())
        .unwrap_or_else(|e| panic!("{name}: {e}"))
}

/// Product of the motions, as another program would compute it.
fn chain(frames: &Value, names: &[&str]) -> Rows {
    let links = names.iter().map(|name| motion(frames, name));
    let product = |a: Rows, b: Rows| {
        std::array::from_fn(|row| {
            std::array::from_fn(|column| (0..4).map(|k| a[row][k] * b[k][column]).sum())
        })
    };
    links.reduce(product).unwrap()
}

fn assert_meet(frames: &Value, a: &[&str], b: &[&str]) {
    let (left, right) = (chain(frames, a), chain(frames, b));
    for (left, right) in left.iter().flatten().zip(right.iter().flatten()) {
        assert!((left - right).abs() < 1e-8, "{a:?} {b:?}: {left} {right}");
    }
}

/// A written room file reads back unchanged, and changing it moves the right frames.
#[test]
fn a_room_file_says_where_everything_is() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    succeed(
        folder.path(),
        "scene room --out a.ply --toml room.toml --frames a.json",
    );
    succeed(
        folder.path(),
        "scene room --room room.toml --out b.ply --frames b.json",
    );
    assert_eq!(
        fs::read(at("a.ply")).unwrap(),
        fs::read(at("b.ply")).unwrap()
    );
    assert_eq!(frames(&at("a.json")), frames(&at("b.json")));

    let text = fs::read_to_string(at("room.toml")).unwrap();
    let farther = text.replace("source_detector_mm = 1100.0", "source_detector_mm = 1300.0");
    fs::write(at("far.toml"), farther).unwrap();
    succeed(
        folder.path(),
        "scene room --room far.toml --out c.ply --frames c.json",
    );
    let far = frames(&at("c.json"));
    assert_eq!(far["source_detector_mm"], 1300.0);
    // The detector does not move: the source and the cameras on it are 200 mm higher.
    for name in ["room_from_device", "room_from_left", "room_from_right"] {
        let (near, far) = (motion(&frames(&at("a.json")), name), motion(&far, name));
        assert!((far[2][3] - near[2][3] - 200.0).abs() < 1e-9, "{name}");
    }
}

/// All motions of a placed limb are consistent.
#[test]
fn frames_of_a_placed_limb_meet() {
    let folder = tempfile::tempdir().unwrap();
    let case = phantom().join("p01.toml");
    let place = format!("scene place {} --angle 20", case.display());
    let args = "--soft-tissue-mm 3,6 --frames f.json --json";
    let placed = succeed(folder.path(), &format!("{place} {args}"));
    let found = frames(&folder.path().join("f.json"));
    assert_meet(&found, &["t_opt", "t_mat", "t_rot"], &["room_from_patient"]);
    assert_meet(
        &found,
        &["room_from_patient", "patient_from_ct", "ct_from_device"],
        &["room_from_device"],
    );
    for side in ["left", "right"] {
        let in_device = format!("device_from_{side}");
        assert_meet(
            &found,
            &["room_from_device", &in_device],
            &[&format!("room_from_{side}")],
        );
    }
    let soft: Value = serde_json::from_str(&placed).unwrap();
    let rigid: Value =
        serde_json::from_str(&succeed(folder.path(), &format!("{place} --json"))).unwrap();
    for contact in [&soft, &rigid] {
        assert!(contact["penetration_mm"].as_f64().unwrap() < 0.1);
        assert!(contact["gap_mm"].as_f64().unwrap() < 0.1);
    }
    let height = |v: &Value| v["room_from_patient"][2][3].as_f64().unwrap();
    let sunk_mm = height(&rigid) - height(&soft);
    assert!(
        (3.0..6.0).contains(&sunk_mm),
        "the joint sinks by {sunk_mm} mm"
    );
}

#[test]
fn broken_room_files_are_reported() {
    let folder = tempfile::tempdir().unwrap();
    let room = folder.path().join("room.toml");
    succeed(folder.path(), "scene room --out a.ply --toml good.toml");
    let good = fs::read_to_string(folder.path().join("good.toml")).unwrap();
    for (from, to, report) in [
        ("version = 1", "version = 2", "version 2"),
        ("[room", "[rooms", "rooms"),
        ("fx = ", "fx = -", "fx"),
    ] {
        fs::write(&room, good.replacen(from, to, 1)).unwrap();
        let said = fail(folder.path(), "scene room --room room.toml --out b.ply");
        assert!(
            said.contains("room.toml") && said.contains(report),
            "{said}"
        );
    }
    assert!(!folder.path().join("b.ply").exists());
    let plan = "version = 1\nroom_file = \"good.toml\"\n[[case]]\nfile = \"a.toml\"\npatient = 0\n";
    fs::write(folder.path().join("plan.toml"), plan).unwrap();
    succeed(folder.path(), "scene room --plan plan.toml --out c.ply");
    fs::write(
        folder.path().join("twice.toml"),
        format!("{plan}[depth]\nrig = \"rig.json\"\n"),
    )
    .unwrap();
    let said = fail(folder.path(), "scene room --plan twice.toml --out d.ply");
    assert!(
        said.contains("room_file") && said.contains("depth.rig"),
        "{said}"
    );
}
