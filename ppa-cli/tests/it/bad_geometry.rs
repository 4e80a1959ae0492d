//! Unusable surfaces, rooms and cameras: one clear sentence, a non-zero exit code, no partial files.

use std::fs;

use crate::{contains, fail, names, phantom, ppa, write_plan};

#[test]
fn an_empty_surface_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let grid = ppa_ct::Grid::axis_aligned(
        [8; 3],
        nalgebra::Vector3::repeat(2.0),
        nalgebra::Point3::origin(),
    );
    let air = ppa_ct::Volume::new(grid.unwrap(), vec![-1000.0; 512]).unwrap();
    ppa_ct::write_nifti(&folder.path().join("air.nii"), &air).unwrap();
    let said = fail(
        folder.path(),
        "prepare air.nii --side r --out case.toml --ply skin.ply",
    );
    contains(&said, &["no limb"]);
    fail(folder.path(), "mesh extract air.nii --out skin.ply");
    assert_eq!(names(folder.path()), ["air.nii"]);
}

#[test]
fn a_mesh_that_is_none_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let put = |name: &str, text: &str| fs::write(folder.path().join(name), text).unwrap();
    let header = "ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\n\
                  property float y\nproperty float z\nend_header\n";
    put("empty.ply", header);
    put("empty.stl", "solid empty\nendsolid empty\n");
    put("nan.obj", "v 0 0 0\nv 1 nan 0\nv 0 1 0\nf 1 2 3\n");
    put("points.obj", "v 0 0 500\nv 1 0 500\nv 0 1 500\n");
    let files = names(folder.path());
    for (command, parts) in [
        (
            "depth render empty.ply --out d.png",
            ["empty.ply", "no vertices"],
        ),
        (
            "mesh cluster empty.stl --eps-mm 1 --min-points 3",
            ["empty.stl", "no vertices"],
        ),
        (
            "depth render nan.obj --out d.png",
            ["vertex 1 of nan.obj", "not a number"],
        ),
        (
            "scene plane nan.obj",
            ["vertex 1 of nan.obj", "not a number"],
        ),
        (
            "depth render points.obj --out d.png",
            ["points.obj", "at least 16"],
        ),
        (
            "depth render mesh.gltf --out d.png",
            ["mesh.gltf", ".ply, .obj or .stl"],
        ),
        (
            "scene room --out room.stl",
            ["room.stl", "ends in .ply or .obj"],
        ),
    ] {
        contains(&fail(folder.path(), command), &parts);
    }
    assert_eq!(names(folder.path()), files);
}

#[test]
fn a_volume_of_one_slice_has_no_surface() {
    let folder = tempfile::tempdir().unwrap();
    let grid = ppa_ct::Grid::axis_aligned(
        [32, 32, 1],
        nalgebra::Vector3::repeat(2.0),
        nalgebra::Point3::origin(),
    );
    let disk = |at: usize| {
        let off_centre = (at % 32).abs_diff(16).pow(2) + (at / 32).abs_diff(16).pow(2);
        if off_centre < 100 { 40.0 } else { -1000.0 }
    };
    let slice = ppa_ct::Volume::new(grid.unwrap(), (0..1024).map(disk).collect()).unwrap();
    ppa_ct::write_nifti(&folder.path().join("slice.nii"), &slice).unwrap();
    for command in [
        "prepare slice.nii --side r --out case.toml --ply skin.ply",
        "mesh extract slice.nii --out skin.ply",
    ] {
        contains(&fail(folder.path(), command), &["32 x 32 x 1 voxels"]);
    }
    assert_eq!(names(folder.path()), ["slice.nii"]);
}

#[test]
fn a_room_without_a_table_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    // A lattice of scattered points without a flat part.
    let mut ply = "ply\nformat ascii 1.0\nelement vertex 500\nproperty float x\n\
                   property float y\nproperty float z\nend_header\n"
        .to_owned();
    for i in 0..500_u32 {
        let scatter = |step: u32| f64::from(i * step % 997) * 2.0 - 1000.0;
        ply += &format!("{} {} {}\n", scatter(379), scatter(613), scatter(811));
    }
    fs::write(folder.path().join("room.ply"), ply).unwrap();
    write_plan(folder.path(), "[room]\nply = \"room.ply\"\n");
    contains(
        &fail(
            folder.path(),
            "generate plan.toml --out data --progress quiet",
        ),
        &["no plane"],
    );
    assert_eq!(names(folder.path()), ["plan.toml", "room.ply"]);
}

#[test]
fn a_camera_that_sees_nothing_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let mut rig = serde_json::to_value(ppa_depth::RigSpec::default()).unwrap();
    // Rotated by 180 degrees about its x axis, the camera looks at the ceiling.
    rig["right"]["device_from_camera"] = serde_json::json!([
        [1.0, 0.0, 0.0, 0.0],
        [0.0, -1.0, 0.0, 0.0],
        [0.0, 0.0, -1.0, 0.0],
        [0.0, 0.0, 0.0, 1.0]
    ]);
    fs::write(folder.path().join("rig.json"), rig.to_string()).unwrap();
    write_plan(folder.path(), "[depth]\nrig = \"rig.json\"\n");
    let said = fail(
        folder.path(),
        "generate plan.toml --out data --progress quiet",
    );
    contains(&said, &["camera"]);
    assert!(!folder.path().join("data/manifest.jsonl").exists());
}

/// A closed box around the camera.
#[test]
fn a_camera_inside_the_limb_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let mut text = String::new();
    for corner in 0..8 {
        let side = |axis: u32| if corner >> axis & 1 == 1 { 300 } else { -300 };
        text += &format!("v {} {} {}\n", side(0), side(1), side(2));
    }
    for face in [
        "1 3 4 2", "5 6 8 7", "1 2 6 5", "3 7 8 4", "1 5 7 3", "2 4 8 6",
    ] {
        text += &format!("f {face}\n");
    }
    fs::write(folder.path().join("box.obj"), text).unwrap();
    let said = fail(folder.path(), "depth render box.obj --out d.png");
    contains(&said, &["box.obj", "camera", "inside"]);
    assert_eq!(names(folder.path()), ["box.obj"]);
}

/// The side of a limb is not guessed: the user must state it.
#[test]
fn a_limb_without_a_side_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let scan = phantom().join("p01.nii");
    let command = format!("prepare {} --out case.toml", scan.display());
    let output = ppa(folder.path(), &command).output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(!output.status.success() && output.stdout.is_empty());
    contains(&said, &["--side"]);
    assert!(names(folder.path()).is_empty());
}

#[test]
fn a_rig_or_a_room_that_cannot_be_used_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let mut rig = serde_json::to_value(ppa_depth::RigSpec::default()).unwrap();
    rig["left"]["device_from_camera"][0][1] = serde_json::json!(0.3);
    fs::write(folder.path().join("rig.json"), rig.to_string()).unwrap();
    write_plan(folder.path(), "[depth]\nrig = \"rig.json\"\n");
    let said = fail(
        folder.path(),
        "generate plan.toml --out data --progress quiet",
    );
    contains(&said, &["rig.json", "left camera"]);

    // A table with every point twice: discs of radius 0.
    let mut ply = "ply\nformat ascii 1.0\nelement vertex 20000\nproperty float x\n\
                   property float y\nproperty float z\nend_header\n"
        .to_owned();
    for i in 0..20_000 {
        ply += &format!("{} {} 0\n", i / 2 % 100 * 12 - 600, i / 200 * 12 - 600);
    }
    fs::write(folder.path().join("room.ply"), ply).unwrap();
    write_plan(folder.path(), "[room]\nply = \"room.ply\"\n");
    let said = fail(
        folder.path(),
        "generate plan.toml --out data --progress quiet",
    );
    contains(&said, &["room.ply", "radius"]);
}
