//! `ppa ct convert` with changes: crop, upright, spacing.

use std::path::Path;

use nalgebra::{Affine3, Matrix4, Point3, Vector3, Vector4};
use ppa_ct::{Grid, Volume, read, write};
use serde_json::Value;

use crate::{fail, names, succeed};

/// Voxels of 1 x 1 x 2 mm, sheared by `lean_mm` along y from slice to slice; each contains its number.
fn volume(lean_mm: f64) -> Volume {
    let mut matrix = Matrix4::from_diagonal(&Vector4::new(1.0, 1.0, 2.0, 1.0));
    matrix[(1, 2)] = lean_mm;
    matrix[(2, 3)] = -400.0;
    let grid = Grid::new([12, 10, 8], Affine3::from_matrix_unchecked(matrix)).unwrap();
    let hu = (0..grid.len()).map(|n| n as f32 - 1000.0).collect();
    Volume::new(grid, hu).unwrap()
}

fn converted(folder: &Path, arguments: &str) -> (Volume, Value) {
    let said = succeed(
        folder,
        &format!("ct convert scan.nrrd out.nrrd --replace {arguments} --json"),
    );
    let volume = read(&folder.join("out.nrrd")).unwrap().volume;
    (volume, serde_json::from_str(&said).unwrap())
}

#[test]
fn boxes_are_cut_out_in_voxels_or_in_millimetres() {
    let folder = tempfile::tempdir().unwrap();
    let scan = volume(0.0);
    write(&folder.path().join("scan.nrrd"), &scan).unwrap();
    let expected = scan.crop([2, 0, 3], [12, 4, 7]).unwrap();
    let (cropped, info) = converted(folder.path(), "--crop 2,12,0,4,3,7");
    assert_eq!(cropped, expected);
    assert_eq!(info["size"], serde_json::json!([10, 4, 4]));
    // The same voxels: centres from 2 to 11, 0 to 3 and -394 to -388 mm.
    let (cropped, _) = converted(folder.path(), "--crop-mm 1.5,20,-9,3.2,-395,-387");
    assert_eq!(cropped, expected);
}

#[test]
fn a_tilted_stack_is_set_upright_before_millimetres_are_cut() {
    let folder = tempfile::tempdir().unwrap();
    // A shear of whole voxels per slice, so every value is copied unchanged.
    let scan = volume(1.0);
    write(&folder.path().join("scan.nrrd"), &scan).unwrap();
    let (kept, info) = converted(folder.path(), "");
    assert_eq!(kept, scan);
    assert_ne!(
        info["direction"][1][2], 0.0,
        "the tilt is kept unless asked"
    );
    let (upright, info) = converted(folder.path(), "--upright");
    assert_eq!(upright.grid().size(), [12, 10 + 7, 8]);
    assert_eq!(info["direction"][1][2], 0.0);
    for n in 0..scan.hu().len() {
        let [i, j, k] = scan.grid().voxel(n);
        assert_eq!(upright.at([i, j + k, k]), scan.hu()[n]);
    }
    assert_eq!(upright.at([0, 9, 0]), -1000.0 + 108.0);
    assert_eq!(upright.at([0, 10, 0]), -1000.0);
    // y from 7 to 9 is in every slice of the upright stack and forms a block.
    let (block, _) = converted(folder.path(), "--upright --crop-mm=-1,20,6.5,9.5,-500,0");
    assert_eq!(block.grid().size(), [12, 3, 8]);
    // Voxel indices are those of the scan as read.
    let (slab, _) = converted(folder.path(), "--upright --crop 0,12,0,10,0,2");
    assert_eq!(slab.grid().size(), [12, 11, 2]);
}

#[test]
fn a_new_spacing_keeps_the_box() {
    let folder = tempfile::tempdir().unwrap();
    let grid = Grid::axis_aligned([12, 10, 8], Vector3::new(1.0, 1.0, 2.0), Point3::origin());
    let grid = grid.unwrap();
    let ramp = |n| {
        let centre = grid.centre(grid.voxel(n).map(|v| v as f64));
        (centre.x * 3.0 - centre.y * 5.0 + centre.z * 7.0) as f32
    };
    let scan = Volume::new(grid.clone(), (0..grid.len()).map(ramp).collect()).unwrap();
    write(&folder.path().join("scan.nrrd"), &scan).unwrap();
    let (fine, info) = converted(folder.path(), "--spacing-mm 0.5");
    assert_eq!(info["size"], serde_json::json!([24, 20, 32]));
    // Linear interpolation between the centres.
    let middle = Point3::new(5.25, 4.75, 7.25);
    assert!((fine.sample(&middle).unwrap() - scan.sample(&middle).unwrap()).abs() < 1e-3);
    let (coarse, info) = converted(folder.path(), "--spacing-mm 2,2.5,4");
    assert_eq!(coarse.grid().size(), [6, 4, 4]);
    assert_eq!(info["spacing_mm"], serde_json::json!([2.0, 2.5, 4.0]));
    assert_eq!(coarse.grid().origin_mm(), Point3::new(0.5, 0.75, 1.0));
}

#[test]
fn changes_that_make_no_volume_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    write(&folder.path().join("scan.nrrd"), &volume(0.5)).unwrap();
    for (arguments, part) in [
        ("--crop 0,13,0,10,0,8", "12 x 10 x 8 voxels"),
        ("--crop 5,5,0,10,0,8", "12 x 10 x 8 voxels"),
        ("--crop-mm 50,60,0,9,-400,-380", "no voxel centre"),
        ("--spacing-mm 0", "expected a length above 0"),
        ("--spacing-mm -1", "expected a length above 0"),
        ("--spacing-mm 0.0001", "voxels"),
        ("--spacing-mm 1,100,1", "side of 10 mm"),
    ] {
        let said = fail(
            folder.path(),
            &format!("ct convert scan.nrrd out.nrrd {arguments}"),
        );
        assert!(said.contains(part), "{arguments}: {said}");
    }
    // Reported by the parser, which adds how to continue.
    for (arguments, part) in [
        ("--crop 1,2,3", "6 voxel indices"),
        ("--crop-mm 0,1,0,1", "6 numbers"),
        ("--crop-mm 0,1,5,4,0,1", "end above its start"),
        ("--spacing-mm 1,2", "three separated by commas"),
        ("--spacing-mm nan", "one number"),
    ] {
        let arguments = format!("ct convert scan.nrrd out.nrrd {arguments}");
        let output = crate::ppa(folder.path(), &arguments).output().unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert!(!output.status.success(), "{arguments}");
        assert!(said.contains(part), "{arguments}: {said}");
    }
    assert_eq!(names(folder.path()), ["scan.nrrd"]);
}
