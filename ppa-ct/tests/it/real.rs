//! Real scans from the folder next to the repository.

use std::path::{Path, PathBuf};

use approx::assert_relative_eq;
use nalgebra::{Matrix4, Point3};
use ppa_ct::{Info, Scan, WarningCode, read};
use serde_json::Value;

pub fn data(path: &str) -> PathBuf {
    let shared = std::env::var_os("PPA_SHARED").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared"),
        PathBuf::from,
    );
    shared.join("data").join(path)
}

pub fn open(path: &str) -> Scan {
    read(&data(path)).unwrap_or_else(|e| panic!("{}", chain(&e)))
}

/// An error with all its causes.
pub fn chain(error: &dyn std::error::Error) -> String {
    let cause = error
        .source()
        .map_or(String::new(), |e| format!(": {}", chain(e)));
    format!("{error}{cause}")
}

pub fn codes(scan: &Scan) -> Vec<WarningCode> {
    scan.warnings.iter().map(|w| w.code).collect()
}

pub fn affine(scan: &Scan) -> &Matrix4<f64> {
    scan.volume.grid().ct_from_voxel().matrix()
}

#[test]
#[ignore = "needs ../shared/data"]
fn the_lower_leg_reads_as_documented() {
    let scan = open("lower-leg-ankle-sts049/dicom");
    let info = Info::of(&scan);
    assert_eq!(info.size, [232, 205, 92]);
    assert_eq!((info.hu_min, info.hu_max), (-1000.0, 1641.0));
    assert_relative_eq!(info.spacing_mm[0], 0.976562, epsilon = 1e-6);
    assert_relative_eq!(info.spacing_mm[2], 3.27, epsilon = 1e-6);
    assert_eq!(info.modality.as_deref(), Some("CT"));
    assert_eq!(codes(&scan), []);
}

#[test]
#[ignore = "needs ../shared/data"]
fn dicom_and_nifti_of_one_subject_agree() {
    for folder in ["knee-calf-sts028", "wrist-hand-sts019"] {
        let dicom = open(&format!("{folder}/dicom"));
        let nifti = open(&format!("{folder}/CT_image.nii.gz"));
        assert_eq!(dicom.volume.grid().size(), nifti.volume.grid().size());
        assert_eq!(dicom.volume.hu(), nifti.volume.hu());
        let apart_mm = (affine(&dicom) - affine(&nifti)).amax();
        assert!(apart_mm < 0.01, "{folder}: {apart_mm}");
    }
}

#[test]
#[ignore = "needs ../shared/data"]
fn one_hand_in_many_containers_is_one_hand() {
    let expected: Value =
        serde_json::from_slice(&std::fs::read(data("hand-reencoded/expected.json")).unwrap())
            .unwrap();
    let number = |v: &Value| v.as_f64().unwrap();
    let reference = open("wrist-hand-sts019/dicom");
    for name in [
        "dicom-unsigned-shuffled",
        "dicom-rle",
        "dicom-jpegll",
        "dicom-jpegls",
        "dicom-j2k",
        "enhanced-ct-shuffled-frames.dcm",
        "hand_int16.nii.gz",
        "hand_scl_sformonly.nii.gz",
        "hand_bigendian.nii.gz",
        "hand_gzip_lps.nrrd",
        "hand_raw_detached.nhdr",
        "hand_ras_f32.nrrd",
        "hand.mhd",
        "hand_z.mhd",
        "hand.mha",
    ] {
        let scan = open(&format!("hand-reencoded/{name}"));
        let info = Info::of(&scan);
        assert_eq!(
            Value::from(info.size.to_vec()),
            expected["size_xyz"],
            "{name}"
        );
        assert_eq!(f64::from(info.hu_min), number(&expected["min"]), "{name}");
        assert_eq!(f64::from(info.hu_max), number(&expected["max"]), "{name}");
        assert_eq!(info.hu_sum, number(&expected["sum"]), "{name}");
        let above = |hu: f32| scan.volume.hu().iter().filter(|v| **v > hu).count();
        assert_eq!(
            above(300.0) as f64,
            number(&expected["count_gt_300"]),
            "{name}"
        );
        assert_eq!(
            above(-500.0) as f64,
            number(&expected["count_gt_m500"]),
            "{name}"
        );
        for axis in 0..3 {
            let truth = number(&expected["origin_lps_mm"][axis]);
            assert_relative_eq!(info.origin_mm[axis], truth, epsilon = 1e-3);
            assert_relative_eq!(info.direction[axis][axis], 1.0, epsilon = 1e-6);
        }
        for sample in expected["samples_ijk_hu"].as_array().unwrap() {
            let voxel = [0, 1, 2].map(|axis| number(&sample[0][axis]) as usize);
            assert_eq!(
                f64::from(scan.volume.at(voxel)),
                number(&sample[1]),
                "{name}"
            );
        }
        assert_eq!(scan.volume.hu(), reference.volume.hu(), "{name}");
    }
}

/// MetaImage as ITK writes it: size, spacing, origin and range match the documentation of the data.
#[test]
#[ignore = "needs ../shared/data"]
fn a_lung_written_by_others_reads_as_documented() {
    let scan = open("lung-mha/3DCT_lung.mha");
    let info = Info::of(&scan);
    assert_eq!(info.size, [115, 157, 129]);
    assert_eq!(info.spacing_mm, [1.366, 1.366, 2.5]);
    assert_eq!(info.origin_mm, [-153.827, -150.352, -1434.5]);
    assert_eq!((info.hu_min, info.hu_max), (-1255.0, 1474.0));
    assert_eq!(codes(&scan), []);
}

/// Another memory order and a rigid motion: voxels are found again at their world positions.
#[test]
#[ignore = "needs ../shared/data"]
fn permuted_and_oblique_axes_keep_the_world() {
    let reference = open("wrist-hand-sts019/dicom").volume;
    let permuted = open("hand-reencoded/hand_permuted_SRA.nii.gz").volume;
    assert_eq!(permuted.hu().len(), reference.hu().len());
    let voxel_from_ct = reference.grid().voxel_from_ct();
    for index in 0..permuted.grid().len() {
        let here = permuted.grid().voxel(index);
        let there = voxel_from_ct * permuted.grid().centre(here.map(|v| v as f64));
        let voxel = [0, 1, 2].map(|axis| there[axis].round() as usize);
        assert!((there - Point3::from(voxel.map(|v| v as f64))).norm() < 1e-3);
        assert_eq!(permuted.at(here), reference.at(voxel));
    }

    let expected: Value =
        serde_json::from_slice(&std::fs::read(data("hand-reencoded/expected.json")).unwrap())
            .unwrap();
    let motion_ras =
        Matrix4::from_fn(|r, c| expected["oblique_ras_rigid_4x4"][r][c].as_f64().unwrap());
    let flip = Matrix4::from_diagonal(&nalgebra::Vector4::new(-1.0, -1.0, 1.0, 1.0));
    let truth = flip * motion_ras * flip * reference.grid().ct_from_voxel().matrix();
    let oblique = open("hand-reencoded/hand_oblique.nii.gz");
    assert_eq!(oblique.volume.hu(), reference.hu());
    assert!((affine(&oblique) - truth).amax() < 1e-3);
}

#[test]
#[ignore = "needs ../shared/data"]
fn a_picture_is_not_taken_for_hounsfield_units() {
    let scan = open("head-phantom-oblique-nifti/CT_pitch.nii.gz");
    assert_eq!(codes(&scan), [WarningCode::NotHu]);
    let metal = open("pelvis-metal-int32/example_ct.nii.gz");
    assert_eq!(codes(&metal), []);
    assert_eq!(Info::of(&metal).hu_max, 3382.0);
}

/// Any file of the data folder, complete or truncated: no panic.
#[test]
#[ignore = "needs ../shared/data"]
fn nothing_panics() {
    fn visit(path: &Path, all: &mut Vec<PathBuf>) {
        all.push(path.to_owned());
        if path.is_dir() {
            let mut inside = std::fs::read_dir(path)
                .unwrap()
                .map(|e| e.unwrap().path())
                .collect::<Vec<_>>();
            inside.sort();
            inside.iter().for_each(|p| visit(p, all));
        }
    }
    let mut all = Vec::new();
    visit(&data(""), &mut all);
    let folder = tempfile::tempdir().unwrap();
    for (n, path) in all.iter().enumerate() {
        let name = path.strip_prefix(data("")).unwrap().display().to_string();
        let siblings = path
            .parent()
            .map_or(0, |p| std::fs::read_dir(p).unwrap().count());
        // A few files of a long series are enough.
        if path.is_file() && siblings > 40 && n % 23 != 0 {
            continue;
        }
        match read(path) {
            Ok(scan) => println!(
                "{name}: {}",
                serde_json::to_string(&Info::of(&scan)).unwrap()
            ),
            Err(error) => println!("{name}: {error}"),
        }
        if path.is_file() {
            let bytes = std::fs::read(path).unwrap();
            for percent in [1, 30, 60, 90, 99] {
                let cut = folder.path().join(path.file_name().unwrap());
                std::fs::write(&cut, &bytes[..bytes.len() * percent / 100]).unwrap();
                if let Ok(scan) = read(&cut) {
                    panic!(
                        "{name} cut to {percent} % reads as {:?}",
                        scan.volume.grid()
                    );
                }
            }
        }
    }
}
