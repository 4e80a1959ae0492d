//! Bad input: one clear sentence, a non-zero exit code, no partial files.

use std::fs;
use std::path::Path;

use crate::{contains, fail, names, phantom, ppa, shared, write_plan};

#[test]
fn a_missing_file_is_named() {
    let folder = tempfile::tempdir().unwrap();
    for command in [
        "ct info nowhere.nii.gz",
        "prepare nowhere.nii.gz --side r --out case.toml",
        "generate nowhere.toml",
        "depth render nowhere.ply --out depth.png",
        "xray simulate nowhere.toml --out x.png",
        "xray audit nowhere.nii",
        "scene plane nowhere.ply",
        "metrics nowhere.csv",
    ] {
        contains(&fail(folder.path(), command), &["nowhere"]);
    }
    assert!(names(folder.path()).is_empty());
}

/// The options for reading a case's scan are stored in the case.
#[test]
fn a_case_is_not_read_otherwise() {
    let said = fail(phantom(), "xray audit p01.toml --force");
    contains(&said, &["p01.toml", "--force"]);
}

/// A named material has its own density.
#[test]
fn a_density_goes_with_a_composition() {
    let folder = tempfile::tempdir().unwrap();
    let command = "xray materials --material water --density 2";
    let output = ppa(folder.path(), command).output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(!output.status.success() && output.stdout.is_empty());
    contains(&said, &["--density", "--material", "cannot be used with"]);
}

#[test]
fn a_broken_calibration_is_reported_with_file_and_place() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("scanner.toml");
    let segment = "[[segment]]\nname = \"all\"\nmaterial = \"water\"\n";
    fs::write(&file, format!("{segment}density = [[0, 1], [-5, 2]]\n")).unwrap();
    write_plan(folder.path(), "calibration_file = \"scanner.toml\"\n");
    let scan = phantom().join("p01.nii");
    let audit = format!("xray audit {} --calibration scanner.toml", scan.display());
    for command in [
        audit.as_str(),
        "generate plan.toml --out data --progress quiet",
    ] {
        let said = fail(folder.path(), command);
        contains(&said, &["scanner.toml", "segment \"all\"", "knot 2"]);
    }
    fs::write(&file, format!("{segment}dense = 3\n")).unwrap();
    contains(&fail(folder.path(), &audit), &["scanner.toml", "line 4"]);
    fs::remove_file(&file).unwrap();
    let said = fail(
        folder.path(),
        "generate plan.toml --out data --progress quiet",
    );
    contains(&said, &["scanner.toml", "cannot be read"]);
}

#[test]
fn settings_that_cannot_work_are_named() {
    let folder = tempfile::tempdir().unwrap();
    for (more, parts) in [
        (
            "[shapes]\noffset_mm = -1.0\n",
            ["shapes.offset_mm", "plan.toml"],
        ),
        ("[shapes]\nvariants = []\n", ["variants", "plan.toml"]),
        ("[shapes]\nvariant = [\"orig\"]\n", ["variant", "plan.toml"]),
        (
            "[room.parametric]\ntable_width_mm = -3.0\n",
            ["table_width_mm", "-3"],
        ),
    ] {
        write_plan(folder.path(), more);
        let output = crate::ppa(folder.path(), "generate plan.toml --out data")
            .output()
            .unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert!(!output.status.success(), "{more} was accepted");
        contains(&said, &parts);
        assert_eq!(names(folder.path()), ["plan.toml"]);
    }
}

#[test]
fn a_scan_that_changed_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    fs::copy(phantom().join("p01.toml"), folder.path().join("p01.toml")).unwrap();
    crate::succeed(folder.path(), "ct phantom --out p01.nii --spacing-mm 3");
    let said = fail(folder.path(), "scene place p01.toml");
    contains(&said, &["p01.nii", "not the scan"]);
}

#[test]
fn a_conversion_that_cannot_be_done_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let scan = phantom().join("p01.nii").display().to_string();
    fs::create_dir(folder.path().join("full")).unwrap();
    fs::write(folder.path().join("full/notes.txt"), "kept").unwrap();
    fs::write(folder.path().join("bad.mha"), "ObjectType = Image\n").unwrap();
    for (command, part) in [
        (
            format!("ct convert {scan} out.dcm"),
            "expected a name ending in",
        ),
        (format!("ct convert {scan} full"), "not an empty folder"),
        (
            format!("ct convert {scan} missing/out.nrrd"),
            "the folder missing does not exist",
        ),
        ("ct convert bad.mha out.nii".to_owned(), "ElementDataFile"),
        ("ct convert nothing.nrrd out.nii".to_owned(), "nothing.nrrd"),
    ] {
        contains(&fail(folder.path(), &command), &[part]);
    }
    assert_eq!(names(folder.path()), ["bad.mha", "full"]);
    assert_eq!(names(&folder.path().join("full")), ["notes.txt"]);
}

#[test]
#[ignore = "needs ../shared/data"]
fn real_scans_that_are_no_ct_volume_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let data = shared().join("data");
    let series = |path: &str| data.join(path).display().to_string();
    let mr = fs::read_dir(data.join("mr-not-ct")).unwrap();
    let mr = mr
        .map(|entry| entry.unwrap().path())
        .find(|path| path.is_dir())
        .unwrap();
    for (path, part) in [
        (mr.display().to_string(), "MR"),
        (series("geometry-only-noise/same-position"), "4"),
        (series("geometry-only-noise/missing-slice"), "mm"),
    ] {
        for command in [
            format!("ct info {path}"),
            format!("ct convert {path} out.nii"),
            format!("prepare {path} --side r --out case.toml"),
        ] {
            contains(&fail(folder.path(), &command), &[part]);
        }
    }
    assert!(names(folder.path()).is_empty());
}

/// Mounts a file system of 400 kB in a mount namespace of its own.
#[test]
#[ignore = "needs the right to mount a file system"]
fn a_full_disk_leaves_only_whole_files() {
    let folder = tempfile::tempdir().unwrap();
    write_plan(folder.path(), "");
    let disk = folder.path().join("disk");
    fs::create_dir(&disk).unwrap();
    let ppa = Path::new(env!("CARGO_BIN_EXE_ppa"));
    let script = format!(
        "mount -t tmpfs -o size=400k tmpfs disk || exit 90; {} generate plan.toml --out disk/data --progress quiet; \
         code=$?; cp -r disk/data copy; exit $code",
        ppa.display()
    );
    let output = std::process::Command::new("unshare")
        .args(["--mount", "--map-root-user", "sh", "-c", &script])
        .current_dir(folder.path())
        .output()
        .unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{said}");
    contains(&said, &["cannot write", "space"]);
    assert_eq!(said.trim_end().lines().count(), 1, "{said}");
    let mut folders = vec![folder.path().join("copy")];
    let mut images = 0;
    while let Some(next) = folders.pop() {
        for entry in fs::read_dir(next).unwrap() {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            assert!(
                name == ".ppa" || !name.starts_with('.'),
                "{} was left behind",
                path.display()
            );
            if path.is_dir() {
                folders.push(path);
            } else if name.starts_with("depth_") {
                ppa_depth::DepthImage::read_png(&path).unwrap();
                images += 1;
            }
        }
    }
    assert!(
        images > 0,
        "some images were whole before the disk was full"
    );
}
