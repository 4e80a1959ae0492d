//! NIfTI: round trips, precedence of orientations, scaling, damage.

use nalgebra::{Point3, Vector3};
use ppa_ct::{ReadError, WarningCode, WriteError, read, write_nifti};
use proptest::prelude::*;

use crate::volumes::{max_abs, small, volumes};

proptest! {
    /// Values come back equal, positions up to the f32 of the header.
    #[test]
    fn what_is_written_comes_back(volume in volumes(), compress in any::<bool>()) {
        let folder = tempfile::tempdir()?;
        let path = folder.path().join(if compress { "v.nii.gz" } else { "v.nii" });
        write_nifti(&path, &volume)?;
        let back = read(&path).map_err(|e| TestCaseError::fail(e.to_string()))?.volume;
        prop_assert_eq!(back.hu(), volume.hu());
        let (a, b) = (back.grid().ct_from_voxel(), volume.grid().ct_from_voxel());
        // f32 has 24 bits, half a unit in the last place below 2048: 6.1e-5.
        prop_assert!(max_abs(a.matrix(), b.matrix()) < 6.2e-5);
        prop_assert_eq!(std::fs::read_dir(folder.path())?.count(), 1, "temporary files left");

        // With the sform switched off, the qform alone must give the same, unless the volume is sheared.
        if !compress {
            let mut bytes = std::fs::read(&path)?;
            bytes[254..256].fill(0);
            let qform = bytes[252] > 0;
            std::fs::write(&path, bytes)?;
            let scan = read(&path).map_err(|e| TestCaseError::fail(e.to_string()))?;
            if qform {
                let by_qform = scan.volume.grid().ct_from_voxel();
                // Near a half turn, the scalar part is the root of a small difference of f32 squares.
                prop_assert!(max_abs(by_qform.matrix(), b.matrix()) < 5e-3);
            } else {
                prop_assert_eq!(scan.warnings[0].code, WarningCode::NoOrientation);
            }
        }
    }
}

/// Writes [`small`], changes some bytes, reads it again.
fn patched(patches: &[(usize, &[u8])]) -> Result<ppa_ct::Scan, ReadError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("v.nii");
    write_nifti(&path, &small()).unwrap();
    let mut bytes = std::fs::read(&path).unwrap();
    for (at, patch) in patches {
        bytes[*at..at + patch.len()].copy_from_slice(patch);
    }
    std::fs::write(&path, bytes).unwrap();
    read(&path)
}

/// The standard's world is RAS: x and y of our LPS change sign, z does not.
#[test]
fn the_file_holds_ras_coordinates() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("v.nii");
    write_nifti(&path, &small()).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    let field = |at: usize| f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
    let srow = [0, 1, 2].map(|row| [0, 1, 2, 3].map(|column| field(280 + 16 * row + 4 * column)));
    assert_eq!(
        srow,
        [
            [-1.0, 0.0, 0.0, 5.0],
            [0.0, -2.0, 0.0, -6.0],
            [0.0, 0.0, 3.0, 7.0]
        ]
    );
    assert_eq!([268, 272, 276].map(field), [5.0, -6.0, 7.0]); // qoffset
    assert_eq!([256, 260, 264].map(field), [0.0, 0.0, 1.0]); // half a turn about z
}

#[test]
fn sform_wins_over_qform() {
    let shifted = patched(&[(268, &99.0_f32.to_le_bytes())]).unwrap(); // qoffset_x
    assert_eq!(shifted.volume, small());
    let by_qform = patched(&[(268, &99.0_f32.to_le_bytes()), (254, &[0, 0])]).unwrap();
    assert_eq!(
        by_qform.volume.grid().origin_mm(),
        Point3::new(-99.0, 6.0, 7.0)
    );
}

#[test]
fn a_slope_of_nan_or_zero_means_as_stored() {
    for slope in [f32::NAN, 0.0] {
        let intercept = 500.0_f32.to_le_bytes();
        let scan = patched(&[(112, &slope.to_le_bytes()), (116, &intercept)]).unwrap();
        assert_eq!(scan.volume.at([0, 0, 0]), -1000.0);
    }
    let half = patched(&[
        (112, &0.5_f32.to_le_bytes()),
        (116, &(-7.0_f32).to_le_bytes()),
    ]);
    assert_eq!(half.unwrap().volume.at([1, 0, 0]), -506.5);
}

#[test]
fn units_of_the_header_are_honoured() {
    let metres = patched(&[(123, &[1])]).unwrap();
    let spacing = metres.volume.grid().spacing_mm();
    assert_eq!(spacing, Vector3::new(1000.0, 2000.0, 3000.0));
}

#[test]
fn values_that_are_no_hounsfield_units_are_flagged() {
    let scan = patched(&[(116, &1000.0_f32.to_le_bytes())]).unwrap(); // 0 to 11
    let codes = scan.warnings.iter().map(|w| w.code).collect::<Vec<_>>();
    assert_eq!(codes, [WarningCode::NotHu]);
}

#[test]
fn headers_that_make_no_volume_are_refused() {
    let nan = f32::NAN.to_le_bytes();
    let damage: [&[(usize, &[u8])]; 8] = [
        &[(40, &[4]), (48, &[2])],      // four axes, two time points
        &[(40, &[2])],                  // two axes
        &[(42, &[0xff, 0xff])],         // −1 voxels
        &[(42, &[0xff, 0x7f])],         // more voxels than bytes
        &[(70, &[128])],                // RGB
        &[(108, &nan)],                 // voxels nowhere
        &[(280, &nan)],                 // sform of NaN
        &[(0, &540_i32.to_le_bytes())], // NIfTI-2
    ];
    for patches in damage {
        assert!(patched(patches).is_err(), "{patches:?}");
    }
}

#[test]
fn a_cut_file_is_an_error_at_every_length() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["v.nii", "v.nii.gz"] {
        let path = folder.path().join(name);
        write_nifti(&path, &small()).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        for length in 0..bytes.len() {
            std::fs::write(&path, &bytes[..length]).unwrap();
            assert!(
                read(&path).is_err(),
                "{length} of {} bytes of {name}",
                bytes.len()
            );
        }
    }
}

#[test]
fn a_flipped_bit_never_changes_the_volume_unnoticed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("v.nii.gz");
    write_nifti(&path, &small()).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    // After the ten bytes of the gzip header, which contain a time and other unchecked fields.
    for at in 10..bytes.len() {
        let mut damaged = bytes.clone();
        damaged[at] ^= 0x10;
        std::fs::write(&path, damaged).unwrap();
        // A copy from another position may still decode to the same bytes.
        let harmless = |scan: ppa_ct::Scan| scan.volume == small();
        assert!(read(&path).map_or(true, harmless), "byte {at}");
    }
}

#[test]
fn free_text_is_reported_by_name() {
    let names = |scan: ppa_ct::Scan| scan.acquisition.identifiers.into_iter().collect::<Vec<_>>();
    assert!(names(patched(&[]).unwrap()).is_empty());
    assert_eq!(names(patched(&[(148, b"Doe")]).unwrap()), ["descrip"]);

    // A 16-byte extension, a comment, before voxels that begin after it.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("v.nii");
    write_nifti(&path, &small()).unwrap();
    let mut bytes = std::fs::read(&path).unwrap();
    bytes[348] = 1;
    bytes[108..112].copy_from_slice(&368.0_f32.to_le_bytes());
    bytes.splice(352..352, *b"\x10\0\0\0\x06\0\0\0Doe^John");
    std::fs::write(&path, bytes).unwrap();
    let scan = read(&path).unwrap();
    assert_eq!(scan.volume, small());
    assert!(!format!("{scan:?}").contains("Doe"));
    assert_eq!(names(scan), ["header extensions"]);
}

#[test]
fn a_failed_write_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let wrong = folder.path().join("v.nrrd");
    assert!(matches!(
        write_nifti(&wrong, &small()),
        Err(WriteError::Extension { .. })
    ));
    let nowhere = folder.path().join("missing/v.nii");
    assert!(matches!(
        write_nifti(&nowhere, &small()),
        Err(WriteError::Io { .. })
    ));
    // Renaming onto a folder fails when all bytes are already written.
    let taken = folder.path().join("v.nii");
    std::fs::create_dir(&taken).unwrap();
    assert!(write_nifti(&taken, &small()).is_err());
    std::fs::remove_dir(&taken).unwrap();
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}

/// `scl_slope` at byte 112, `scl_inter` at 116: values from the format's authors and from common programs.
#[test]
fn invalid_scalings_are_refused() {
    let scaled = |slope: f32, intercept: f32| {
        patched(&[(112, &slope.to_le_bytes()), (116, &intercept.to_le_bytes())])
    };
    for (slope, intercept) in [
        (0.0, 0.0),
        (f32::NAN, f32::NAN),
        (f32::NAN, 5.0),
        (0.0, f32::INFINITY),
    ] {
        assert_eq!(
            scaled(slope, intercept).unwrap().volume,
            small(),
            "{slope} {intercept}"
        );
    }
    let half = scaled(-0.5, 3.0).unwrap().volume;
    assert_eq!(half.at([0, 0, 0]), 503.0);
    for (slope, intercept) in [
        (f32::INFINITY, 0.0),
        (f32::NEG_INFINITY, 0.0),
        (1.0, f32::NAN),
        (2.0, f32::INFINITY),
    ] {
        let error = scaled(slope, intercept).unwrap_err();
        assert!(matches!(error, ReadError::Header { .. }), "{error}");
        assert!(error.to_string().contains("scl_slope"), "{error}");
    }
}
