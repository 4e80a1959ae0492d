//! `ppa xray mcgpu`: keys, files and errors.

use std::fs;
use std::ops::ControlFlow;
use std::path::Path;
use std::time::Duration;

use ppa_xray::Engine;
use ppa_xray::mcgpu::{RunLength, Scan, Simulation};
use serde_json::Value;

use crate::{contents, fail, names, succeed};

/// Writes a water box in front of a small detector, with two projections and doses.
pub fn write_input(folder: &Path) {
    let header =
        "[SECTION VOXELS HEADER v.2008-04-13]\n4 4 4\n1 1 1\n1\n2\n0\n[END OF VXH SECTION]\n";
    fs::write(
        folder.join("box.vox"),
        header.to_owned() + &"1 1.0\n".repeat(64),
    )
    .unwrap();
    fs::write(folder.join("beam.spc"), "40000 1\n60000 -1\n").unwrap();
    let input = "#[SECTION SIMULATION CONFIG v.2009-05-12]\n2e5\n1\n0\n128\n150\n\
        #[SECTION SOURCE v.2011-07-12]\nbeam.spc\n2 -50 2\n0 1 0\n-1 -1\n\
        #[SECTION IMAGE DETECTOR v.2009-12-02]\nimage.dat\n10 10\n10 10\n60\n\
        #[SECTION CT SCAN TRAJECTORY v.2011-10-25]\n2\n90\n0 720\n52\n0\n\
        #[SECTION DOSE DEPOSITION v.2012-12-12]\nYES\nYES\ndose.dat\n1 4\n1 4\n1 4\n\
        #[SECTION VOXELIZED GEOMETRY FILE v.2009-11-30]\nbox.vox\n\
        #[SECTION MATERIAL FILE LIST v.2009-11-30]\nppa:water\n";
    fs::write(folder.join("box.in"), input).unwrap();
}

#[test]
fn result_has_its_keys_and_equal_seeds_give_equal_bytes() {
    let folder = tempfile::tempdir().unwrap();
    write_input(folder.path());
    // Paths are relative to the input file, not to the current folder.
    let elsewhere = tempfile::tempdir().unwrap();
    let run = |out: &str, more: &str| -> Value {
        let input = folder.path().join("box.in");
        let arguments = format!("xray mcgpu {} --out {out} --json {more}", input.display());
        serde_json::from_str(&succeed(elsewhere.path(), &arguments)).unwrap()
    };
    let first = run("first", "--histories 20000");
    for key in ["histories", "engine", "wall_s", "cpu_s"] {
        assert!(first.get(key).is_some(), "{key}: {first}");
    }
    assert_eq!(first["histories"], 20_000.0);
    assert_eq!(first["engine"], "analog");
    let projections = first["projections"].as_array().unwrap();
    assert_eq!(projections.len(), 2);
    for projection in projections {
        for name in ["primary", "compton", "rayleigh", "multiple"] {
            let value = projection[format!("{name}_ev_per_history")]
                .as_f64()
                .unwrap();
            let se = projection[format!("{name}_ev_per_history_se")]
                .as_f64()
                .unwrap();
            assert!(0.0 < se && se < value, "{projection}");
        }
    }
    let dose = first["material_dose_ev_per_history"].as_array().unwrap();
    assert!(dose.len() == 1 && dose[0].as_f64().unwrap() > 1_000.0);
    let files = [
        "dose.dat",
        "dose.dat.raw",
        "dose.dat_PercentRelError2sigma.raw",
        "image.dat_0000",
        "image.dat_0000.raw",
        "image.dat_0001",
        "image.dat_0001.raw",
    ];
    assert_eq!(names(&elsewhere.path().join("first")), files);
    run("again", "--histories 20000 --seed 1");
    run("other", "--histories 20000 --seed 2");
    let bytes = |run: &str, file: &str| fs::read(elsewhere.path().join(run).join(file)).unwrap();
    for file in files {
        assert_eq!(bytes("first", file), bytes("again", file), "{file}");
        assert_ne!(bytes("first", file), bytes("other", file), "{file}");
    }
}

/// Writes an input in `folder`, and in `folder/images` its scan, interrupted in the second projection.
fn write_interrupted(folder: &Path) {
    write_input(folder);
    let out = folder.join("images");
    fs::create_dir(&out).unwrap();
    let simulation = Simulation::read(folder.join("box.in")).unwrap();
    let mut scan = Scan::new(
        &simulation,
        RunLength::Histories(20_000),
        Engine::Analog,
        out,
    );
    let stations = simulation.input().stations();
    let [first, second] = &stations[..] else {
        panic!("two projections");
    };
    let (image, dose) = scan
        .analog(first, Duration::MAX, |_| ControlFlow::Continue(()))
        .unwrap()
        .unwrap();
    scan.add(first, &image, dose.as_ref()).unwrap();
    let stop = scan.analog(second, Duration::MAX, |_| ControlFlow::Break(()));
    assert!(stop.unwrap().is_none());
}

const RESUME: &str = "xray mcgpu box.in --histories 20000 --out images";

#[test]
fn an_interrupted_scan_resumes_to_the_result_of_a_whole_one() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    write_interrupted(here);
    let result = |out: &str| -> Value {
        let whole = RESUME.replace("images", out);
        let mut result: Value =
            serde_json::from_str(&succeed(here, &format!("{whole} --json"))).unwrap();
        let keys = result.as_object_mut().unwrap();
        keys.retain(|key, _| key != "wall_s" && key != "cpu_s");
        serde_json::from_str(&result.to_string().replace(&format!("{out}/"), "")).unwrap()
    };
    assert_eq!(result("images"), result("whole"));
    assert!(contents(&here.join("images")) == contents(&here.join("whole")));
}

#[test]
fn a_scan_of_another_input_is_not_resumed() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    write_interrupted(here);
    let before = contents(&here.join("images"));
    let refused = |arguments: &str| {
        let said = fail(here, arguments);
        assert!(
            said.contains("image.dat.tally belongs to another scan"),
            "{said}"
        );
        assert!(said.contains("--replace starts over"), "{said}");
        assert!(contents(&here.join("images")) == before);
    };
    refused(&format!("{RESUME} --seed 2"));
    refused(&RESUME.replace("20000", "30000"));
    let changes = [
        ("box.in", "ppa:water", "ppa:muscle"),
        ("box.in", "1 4\n1 4\n1 4", "1 4\n1 4\n1 3"),
        ("box.vox", "1 1.0", "1 1.1"),
        ("beam.spc", "40000 1", "41000 1"),
    ];
    for (file, from, to) in changes {
        let path = here.join(file);
        let text = fs::read_to_string(&path).unwrap();
        fs::write(&path, text.replacen(from, to, 1)).unwrap();
        refused(RESUME);
        fs::write(&path, text).unwrap();
    }
    // A comment changes nothing, nor does another path to the same folder.
    let input = fs::read_to_string(here.join("box.in")).unwrap();
    fs::write(here.join("box.in"), input + "# a comment\n").unwrap();
    succeed(here, &RESUME.replace("box.in", "./box.in"));
}

#[test]
fn replace_begins_another_scan_again() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    write_interrupted(here);
    succeed(here, &format!("{RESUME} --seed 2 --replace"));
    let whole = RESUME.replace("images", "whole");
    succeed(here, &format!("{whole} --seed 2"));
    assert!(contents(&here.join("images")) == contents(&here.join("whole")));
}

#[test]
fn images_of_others_are_kept_when_a_scan_resumes() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    write_interrupted(here);
    let images = here.join("images");
    for (name, bytes) in [
        ("image.dat_0000", "changed"),
        ("image.dat_0001.raw", "mine"),
        ("dose.dat", "mine"),
    ] {
        let path = images.join(name);
        let before = fs::read(&path).ok();
        fs::write(&path, bytes).unwrap();
        let said = fail(here, RESUME);
        assert!(said.contains(&format!("{name} exists: give --replace")));
        assert_eq!(fs::read_to_string(&path).unwrap(), bytes);
        match before {
            Some(before) => fs::write(&path, before).unwrap(),
            None => fs::remove_file(&path).unwrap(),
        }
    }
    // A lost complete image is simulated again without counting its dose twice.
    fs::remove_file(images.join("image.dat_0000")).unwrap();
    succeed(here, RESUME);
    succeed(here, &RESUME.replace("images", "whole"));
    assert!(contents(&images) == contents(&here.join("whole")));
}

#[test]
fn a_damaged_tally_of_a_scan_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    write_interrupted(here);
    let path = here.join("images/image.dat.tally");
    let bytes = fs::read(&path).unwrap();
    let mut flipped = bytes.clone();
    flipped[bytes.len() - 500] ^= 1;
    for (bytes, report) in [
        (&bytes[..bytes.len() - 1], "truncated or appended to"),
        (&flipped, "its checksum does not match"),
        (&b"my notes"[..], "is not a tally"),
    ] {
        fs::write(&path, bytes).unwrap();
        let said = fail(here, RESUME);
        assert!(said.contains(report), "{report:?} is missing in: {said}");
        assert_eq!(fs::read(&path).unwrap(), bytes);
    }
}

#[test]
fn images_of_the_fast_engine_are_kept_as_well() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    write_input(here);
    let text = fs::read_to_string(here.join("box.in")).unwrap();
    fs::write(here.join("box.in"), text.replace("YES", "NO")).unwrap();
    let run = format!("{RESUME} --engine fast");
    let simulation = Simulation::read(here.join("box.in")).unwrap();
    let length = RunLength::Histories(20_000);
    let images = here.join("images");
    fs::create_dir(&images).unwrap();
    let mut scan = Scan::new(&simulation, length, Engine::Fast, &images);
    let station = &simulation.input().stations()[0];
    // Any image is enough to check that it is kept.
    let (image, _) = simulation
        .analog(station, length, |_| ControlFlow::Continue(()))
        .unwrap();
    scan.add(station, &image, None).unwrap();
    let before = contents(&images);
    assert!(fail(here, RESUME).contains("belongs to another scan"));
    succeed(here, &run);
    let after = contents(&images);
    for name in ["image.dat_0000", "image.dat_0000.raw"] {
        let path = Path::new(name);
        assert!(before.contains_key(path) && before.get(path) == after.get(path));
    }
    assert!(after.contains_key(Path::new("image.dat_0001")));
}

#[test]
fn mistakes_are_reported_and_leave_nothing_behind() {
    let folder = tempfile::tempdir().unwrap();
    write_input(folder.path());
    let text = fs::read_to_string(folder.path().join("box.in")).unwrap();
    for (from, to, more, report) in [
        (
            "ppa:water",
            "water.mcgpu.gz",
            "",
            "material file 1 water.mcgpu.gz is not a file",
        ),
        (
            "0 720",
            "0 90",
            "",
            "no projection has an angle of interest",
        ),
        ("2e5", "none", "", "expected the number of histories"),
        ("", "", "--histories 0", "--histories is 0"),
        ("", "", "--engine fast", "asks for doses"),
        (
            "YES\nYES",
            "NO\nNO",
            "--engine fast --histories nan",
            "--histories is NaN",
        ),
        ("2 -50 2", "2 -50 90", "", "misses"),
    ] {
        fs::write(folder.path().join("bad.in"), text.replacen(from, to, 1)).unwrap();
        let said = fail(
            folder.path(),
            &format!("xray mcgpu bad.in --out results {more}"),
        );
        assert!(said.contains(report), "{report:?} is missing in: {said}");
        assert!(!folder.path().join("results").exists(), "{report}");
    }
    let nowhere = "xray mcgpu nowhere.in --out results";
    assert!(fail(folder.path(), nowhere).contains("nowhere.in"));
    // An existing folder is kept.
    fs::create_dir(folder.path().join("mine")).unwrap();
    fail(folder.path(), "xray mcgpu bad.in --out mine");
    assert!(names(&folder.path().join("mine")).is_empty());
}

#[test]
fn a_damaged_spectrum_is_reported_with_its_line_and_named_once() {
    let folder = tempfile::tempdir().unwrap();
    write_input(folder.path());
    for (text, report) in [
        ("40000 1\nsixty -1\n", "line 2: found \"sixty -1\""),
        ("40000 NaN\n60000 -1\n", "energy bin 0 has weight NaN"),
        ("40000 1\n999000 -1\n", "between 40 and 999 keV"),
    ] {
        fs::write(folder.path().join("beam.spc"), text).unwrap();
        let said = fail(folder.path(), "xray mcgpu box.in --out results");
        assert!(said.contains(report), "{report:?} is missing in: {said}");
        assert_eq!(said.matches("beam.spc").count(), 1, "{said}");
    }
}

#[test]
fn a_time_limits_the_run_and_fast_makes_no_dose() {
    let folder = tempfile::tempdir().unwrap();
    write_input(folder.path());
    let text = fs::read_to_string(folder.path().join("box.in")).unwrap();
    let text = text.replace("YES\nYES", "NO\nNO").replace("2e5", "0.2");
    fs::write(folder.path().join("short.in"), text).unwrap();
    let run = |more: &str| -> Value {
        let arguments = format!("xray mcgpu short.in --out results --json {more}");
        serde_json::from_str(&succeed(folder.path(), &arguments)).unwrap()
    };
    let analog = run("");
    assert!(analog["histories"].as_f64().unwrap() > 1_000.0, "{analog}");
    assert!(analog.get("material_dose_ev_per_history").is_none());
    let again = fail(folder.path(), "xray mcgpu short.in --out results");
    assert!(again.contains("--replace"), "{again}");
    let fast = run("--engine fast --histories 1e9 --replace");
    assert_eq!(fast["engine"], "fast");
    assert_eq!(fast["histories"], 1e9);
    let primary = |run: &Value| {
        run["projections"][0]["primary_ev_per_history"]
            .as_f64()
            .unwrap()
    };
    let ratio = primary(&analog) / primary(&fast);
    assert!((ratio - 1.0).abs() < 0.1, "{ratio}");
}
