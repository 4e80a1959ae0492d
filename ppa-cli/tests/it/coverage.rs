//! `ppa depth coverage`: comparison of camera places.

use std::fs;

use serde_json::Value;

use crate::{fail, phantom, succeed};

#[test]
fn places_are_ranked_drawn_and_written() {
    let folder = tempfile::tempdir().unwrap();
    let case = phantom().join("p01.toml");
    let study = format!(
        "depth coverage {} --step-deg 45 --lowest-deg 45 --distances-mm 700",
        case.display()
    );
    let found = succeed(
        folder.path(),
        &format!("{study} --csv c.csv --plot c.png --json"),
    );
    let found: Value = serde_json::from_str(&found).unwrap();
    let places = found["places"].as_array().unwrap();
    // Straight above, six around (360° cos 45° / 45°), and the two cameras of the rig.
    assert_eq!(places.len(), 9);
    let names = places.iter().map(|place| place["name"].as_str().unwrap());
    assert_eq!(names.filter(|name| name.starts_with("rig ")).count(), 2);
    let shares: Vec<f64> = places
        .iter()
        .map(|place| place["visible_share"].as_f64().unwrap())
        .collect();
    assert!(
        shares
            .windows(2)
            .all(|pair| (100.0 * pair[0]).round() >= (100.0 * pair[1]).round()),
        "{shares:?}"
    );
    // No camera sees the side that faces the table.
    assert!(shares[0] > 0.3 && shares[0] < 0.7, "{shares:?}");
    for place in places.iter().filter(|place| place["name"] == "dome") {
        let side_mm = place["mm_per_pixel"].as_f64().unwrap();
        // Perpendicular at 700 mm, a pixel is 700 / 505 mm; the joint's surface is a little nearer, and oblique.
        assert!((1.2..2.2).contains(&side_mm), "{side_mm}");
    }
    let table = fs::read_to_string(folder.path().join("c.csv")).unwrap();
    assert_eq!(table.lines().count(), 10);
    let plot = image::open(folder.path().join("c.png")).unwrap();
    assert!(plot.width() > 1000);

    // User-defined places: the best place again, and its mirror image below the table, where the table hides everything.
    let best = &places[0]["room_from_camera"];
    let below = "[[1,0,0,0],[0,1,0,0],[0,0,1,-700],[0,0,0,1]]";
    let own = format!(
        r#"[{{"name": "again", "room_from_camera": {best}}}, {{"name": "below", "room_from_camera": {below}}}]"#
    );
    fs::write(folder.path().join("own.json"), own).unwrap();
    let study = format!("depth coverage {} --places own.json --json", case.display());
    let own: Value = serde_json::from_str(&succeed(folder.path(), &study)).unwrap();
    let share = |name: &str| {
        let mut places = own["places"].as_array().unwrap().iter();
        places.find(|place| place["name"] == name).unwrap()["visible_share"].clone()
    };
    assert!((share("again").as_f64().unwrap() - shares[0]).abs() < 1e-6);
    assert_eq!(share("below"), 0.0);
}

#[test]
fn places_that_make_no_sense_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let case = phantom().join("p01.toml");
    fs::write(
        folder.path().join("scaled.json"),
        r#"[{"name": "wall", "room_from_camera": [[2,0,0,0],[0,2,0,0],[0,0,2,0],[0,0,0,1]]}]"#,
    )
    .unwrap();
    for (options, named) in [
        ("--step-deg 0", "--step-deg is 0"),
        ("--step-deg nan", "--step-deg is NaN"),
        ("--lowest-deg 91", "--lowest-deg is 91"),
        ("--distances-mm 700,-3", "-3"),
        ("--step-deg 1", "at most 10000"),
        ("--radius-mm 0", "radius around the joint is 0 mm"),
        ("--max-angle-deg 90", "90 degrees"),
        ("--places scaled.json", "place wall of scaled.json"),
        ("--places missing.json", "missing.json"),
    ] {
        let command = format!("depth coverage {} --csv no.csv {options}", case.display());
        let said = fail(folder.path(), &command);
        assert!(said.contains(named), "{options}: {said}");
        assert!(!folder.path().join("no.csv").exists(), "{options}");
    }
}
