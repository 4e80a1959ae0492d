//! DICOM slices written, read back, and checked element by element.

use std::fs;
use std::path::Path;

use dicom_dictionary_std::tags;
use nalgebra::{Affine3, Matrix3, Point3, Vector3};
use ppa_ct::{Grid, Volume, WarningCode, WriteError, read, write_dicom};
use proptest::prelude::*;

use crate::volumes::{small, volumes};

/// The volume with its slices in reverse order, at the same positions.
fn reversed(volume: &Volume) -> Volume {
    let [nx, ny, nz] = volume.grid().size();
    let mut matrix = *volume.grid().ct_from_voxel().matrix();
    let last = volume.grid().centre([0.0, 0.0, nz as f64 - 1.0]);
    let step = -matrix.column(2);
    matrix.set_column(2, &step);
    matrix.fixed_view_mut::<3, 1>(0, 3).copy_from(&last.coords);
    let hu = volume.hu();
    let slices = hu.chunks(nx * ny).rev();
    let grid = Grid::new([nx, ny, nz], Affine3::from_matrix_unchecked(matrix)).unwrap();
    Volume::new(grid, slices.flatten().copied().collect()).unwrap()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Integers come back equal, other values within half a level; positions within a nanometre.
    #[test]
    fn what_is_written_comes_back(volume in volumes(), tilt in -0.4..0.4_f64) {
        // Leaning slices are a gantry tilt, leaning rows are not.
        let mut matrix = *volume.grid().ct_from_voxel().matrix();
        let [i, j, k] = [0, 1, 2].map(|axis| matrix.fixed_view::<3, 1>(0, axis).into_owned());
        let upright = j - i * (i.dot(&j) / i.norm_squared());
        matrix.fixed_view_mut::<3, 1>(0, 1).copy_from(&upright);
        matrix.fixed_view_mut::<3, 1>(0, 2).copy_from(&(k + i.normalize() * tilt));
        let grid = Grid::new(volume.grid().size(), Affine3::from_matrix_unchecked(matrix))?;
        let volume = Volume::new(grid, volume.hu().to_vec())?;

        let parent = tempfile::tempdir()?;
        let folder = parent.path().join("series");
        write_dicom(&folder, &volume)?;
        let slices = volume.grid().size()[2];
        prop_assert_eq!(fs::read_dir(&folder)?.count(), slices);
        prop_assert_eq!(fs::read_dir(parent.path())?.count(), 1, "temporary files left");
        let back = read(&folder).map_err(|e| TestCaseError::fail(e.to_string()))?;
        prop_assert_eq!(back.modality.as_deref(), Some("CT"));

        let axes = matrix.fixed_view::<3, 3>(0, 0).into_owned();
        let upright = if axes.determinant() < 0.0 { reversed(&volume) } else { volume };
        let range = upright.hu().iter().fold([f32::MAX, f32::MIN], |[low, high], &v| {
            [low.min(v), high.max(v)]
        });
        let whole = upright.hu().iter().all(|v| v.fract() == 0.0);
        let most = if whole { 0.0 } else { (range[1] - range[0]) / 131_068.0 + 1e-3 };
        for (a, b) in back.volume.hu().iter().zip(&*upright.hu()) {
            prop_assert!((a - b).abs() <= most, "{a} {b} {most}");
        }
        let size = upright.grid().size();
        prop_assert_eq!(back.volume.grid().size(), size);
        // A single slice does not determine the direction of the step.
        let corners = if slices > 1 { size } else { [size[0], size[1], 1] };
        for corner in 0..8 {
            let voxel = [0, 1, 2].map(|axis| (corner >> axis & 1) as f64 * (corners[axis] - 1) as f64);
            let apart_mm =
                (back.volume.grid().centre(voxel) - upright.grid().centre(voxel)).norm();
            prop_assert!(apart_mm < 1e-6, "{apart_mm} mm");
        }
    }
}

#[test]
fn the_same_volume_gives_the_same_bytes() {
    let parent = tempfile::tempdir().unwrap();
    let bytes = |name: &str, volume: &Volume| {
        let folder = parent.path().join(name);
        write_dicom(&folder, volume).unwrap();
        [1, 2].map(|n| fs::read(folder.join(format!("slice_000{n}.dcm"))).unwrap())
    };
    let first = bytes("a", &small());
    assert_eq!(first, bytes("b", &small()));
    let moved = Grid::axis_aligned([3, 2, 2], Vector3::new(1.0, 2.0, 3.0), Point3::origin());
    let moved = Volume::new(moved.unwrap(), small().hu().to_vec()).unwrap();
    let other = bytes("c", &moved);
    let uid = |bytes: &[u8], tag| {
        let object = dicom_object::from_reader(bytes).unwrap();
        object.element(tag).unwrap().to_str().unwrap().into_owned()
    };
    let series = [&first[0], &first[1], &other[0]].map(|b| uid(b, tags::SERIES_INSTANCE_UID));
    assert!(series[0] == series[1] && series[0] != series[2]);
    let instances = [&first[0], &first[1], &other[0]].map(|b| uid(b, tags::SOP_INSTANCE_UID));
    assert!(instances[0] != instances[1] && instances[0] != instances[2]);
    for one in series.iter().chain(&instances) {
        assert!(one.len() <= 64 && one.starts_with("2.25.") && !one[5..].starts_with('0'));
    }
}

#[test]
fn a_slice_says_where_it_is_and_nothing_about_anyone() {
    let parent = tempfile::tempdir().unwrap();
    let folder = parent.path().join("series");
    write_dicom(&folder, &small()).unwrap();
    let object = dicom_object::open_file(folder.join("slice_0002.dcm")).unwrap();
    let text = |tag| {
        object
            .element(tag)
            .unwrap()
            .to_str()
            .unwrap()
            .trim()
            .to_owned()
    };
    assert_eq!(text(tags::IMAGE_POSITION_PATIENT), "-5\\6\\10");
    assert_eq!(text(tags::IMAGE_ORIENTATION_PATIENT), "1\\0\\0\\0\\1\\0");
    assert_eq!(text(tags::PIXEL_SPACING), "2\\1");
    assert_eq!(text(tags::SLICE_THICKNESS), "3");
    assert_eq!(
        [text(tags::RESCALE_SLOPE), text(tags::RESCALE_INTERCEPT)],
        ["1", "0"]
    );
    for unknown in [
        tags::PATIENT_NAME,
        tags::PATIENT_ID,
        tags::STUDY_DATE,
        tags::STUDY_ID,
    ] {
        assert_eq!(text(unknown), "");
    }
}

/// Gantry tilt follows from the positions, the spacing of a single slice from its thickness.
#[test]
fn tilt_and_single_slices_survive() {
    let parent = tempfile::tempdir().unwrap();
    let axes = Matrix3::new(1.0, 0.0, 0.0, 0.0, 1.0, -0.6, 0.0, 0.0, 2.0);
    let matrix = axes.to_homogeneous();
    let grid = Grid::new([3, 2, 2], Affine3::from_matrix_unchecked(matrix)).unwrap();
    let tilted = Volume::new(grid, small().hu().to_vec()).unwrap();
    let folder = parent.path().join("tilted");
    write_dicom(&folder, &tilted).unwrap();
    let back = read(&folder).unwrap();
    assert_eq!(back.volume, tilted);
    assert_eq!(back.warnings[0].code, WarningCode::GantryTilt);
    let single = small().crop([0, 0, 0], [3, 2, 1]).unwrap();
    let folder = parent.path().join("single");
    write_dicom(&folder, &single).unwrap();
    assert_eq!(read(&folder).unwrap().volume, single);
}

/// What can be read can also be written: direction cosines rounded to three digits.
#[test]
fn axes_nearly_at_right_angles_survive() {
    let parent = tempfile::tempdir().unwrap();
    let leaning = Matrix3::new(1.0, 0.004, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 2.0);
    let grid = Grid::new(
        [3, 2, 2],
        Affine3::from_matrix_unchecked(leaning.to_homogeneous()),
    );
    let volume = Volume::new(grid.unwrap(), small().hu().to_vec()).unwrap();
    let folder = parent.path().join("leaning");
    write_dicom(&folder, &volume).unwrap();
    let back = read(&folder).unwrap().volume;
    assert_eq!(back.hu(), volume.hu());
    let apart = back.grid().ct_from_voxel().matrix() - volume.grid().ct_from_voxel().matrix();
    assert!(apart.amax() < 1e-9, "{apart}");
}

#[test]
fn a_failed_write_leaves_nothing() {
    let parent = tempfile::tempdir().unwrap();
    let leaning = Matrix3::new(1.0, 0.1, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);
    let grid = Grid::new(
        [3, 2, 2],
        Affine3::from_matrix_unchecked(leaning.to_homogeneous()),
    );
    let volume = Volume::new(grid.unwrap(), small().hu().to_vec()).unwrap();
    let refused = write_dicom(&parent.path().join("leaning"), &volume);
    assert!(matches!(refused, Err(WriteError::SlantedSlices { lean_deg }) if lean_deg > 5.0));
    let refused = write_dicom(&parent.path().join("missing/series"), &small());
    assert!(matches!(refused, Err(WriteError::Io { .. })));
    assert_eq!(fs::read_dir(parent.path()).unwrap().count(), 0);

    // An empty folder is used, one with anything in it is never touched.
    let empty = parent.path().join("empty");
    fs::create_dir(&empty).unwrap();
    write_dicom(&empty, &small()).unwrap();
    assert!(matches!(
        write_dicom(&empty, &small()),
        Err(WriteError::Exists { .. })
    ));
    let file = parent.path().join("file");
    fs::write(&file, "kept").unwrap();
    assert!(matches!(
        write_dicom(&file, &small()),
        Err(WriteError::Exists { .. })
    ));
    assert_eq!(fs::read(&file).unwrap(), b"kept");
    assert_eq!(fs::read_dir(parent.path()).unwrap().count(), 2);
    assert!(write_dicom(Path::new("/dev/null/series"), &small()).is_err());
}
