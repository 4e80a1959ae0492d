//! Synthetic DICOM series: geometry, values, refusals.

use std::path::Path;

use approx::assert_relative_eq;
use dicom_dictionary_std::uids;
use nalgebra::{Point3, Rotation3, Vector3};
use ppa_ct::{Info, ReadError, ReadOptions, SeriesChoice, Values, WarningCode, read, read_with};
use proptest::prelude::*;

use crate::series::{SliceSpec, write_series};

fn axial_stack(heights: &[f64]) -> Vec<SliceSpec> {
    let slice = |(n, &z): (usize, &f64)| {
        SliceSpec::axial([4, 3], z, move |i, j| (100 * n + 10 * j + i) as i16 - 1000)
    };
    heights.iter().enumerate().map(slice).collect()
}

fn codes(path: &Path) -> Vec<WarningCode> {
    let scan = read(path).expect("a readable series");
    scan.warnings.iter().map(|w| w.code).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Each voxel is where its slice put it, whatever the orientation, tilt and file order.
    #[test]
    fn voxels_lie_where_their_slices_say(
        angles in prop::array::uniform3(-3.0..3.0_f64),
        tilt_mm in prop::array::uniform2(-1.0..1.0_f64),
        step_mm in 0.3..5.0_f64,
        spacing_mm in prop::array::uniform2(0.2..2.0_f64),
        size in prop::array::uniform2(1..6_u16),
        shuffled in Just((0..7).collect::<Vec<i32>>()).prop_shuffle(),
    ) {
        let turn = Rotation3::from_euler_angles(angles[0], angles[1], angles[2]);
        let [u, v] = [turn * Vector3::x(), turn * Vector3::y()];
        let step = turn * Vector3::new(tilt_mm[0], tilt_mm[1], step_mm);
        let slices = shuffled.iter().map(|&k| SliceSpec {
            position: Point3::new(-31.0, 7.0, 100.0) + step * f64::from(k),
            along_row: u,
            down_column: v,
            spacing_mm,
            ..SliceSpec::axial(size, 0.0, |i, j| (100 * k as usize + 10 * j + i) as i16 - 1000)
        });
        let folder = tempfile::tempdir()?;
        write_series(folder.path(), &slices.collect::<Vec<_>>());

        let volume = read(folder.path()).map_err(|e| TestCaseError::fail(e.to_string()))?.volume;
        let grid = volume.grid();
        prop_assert_eq!(grid.size(), [size[0].into(), size[1].into(), 7]);
        for index in 0..grid.len() {
            let [i, j, k] = grid.voxel(index);
            prop_assert_eq!(volume.at([i, j, k]), (100 * k + 10 * j + i) as f32 - 1000.0);
            let truth = Point3::new(-31.0, 7.0, 100.0) + step * k as f64
                + u * (i as f64 * spacing_mm[0]) + v * (j as f64 * spacing_mm[1]);
            let error_mm = (grid.centre([i as f64, j as f64, k as f64]) - truth).norm();
            prop_assert!(error_mm < 1e-6, "{error_mm} mm");
        }
    }
}

#[test]
fn stored_bits_and_rescale_are_applied_per_slice() {
    let encodings = [
        uids::IMPLICIT_VR_LITTLE_ENDIAN,
        uids::EXPLICIT_VR_LITTLE_ENDIAN,
        "1.2.840.10008.1.2.2", // explicit VR big endian, retired
        uids::DEFLATED_EXPLICIT_VR_LITTLE_ENDIAN,
    ];
    for syntax in encodings {
        let folder = tempfile::tempdir().unwrap();
        let mut slices = axial_stack(&[0.0, 2.0]);
        for slice in &mut slices {
            slice.syntax = syntax;
            slice.bits_stored = 12;
        }
        // Twelve bits, all set: 4095 unsigned, −1 signed; the bits above are noise.
        (slices[0].signed, slices[0].rescale) = (false, [2.0, -1024.0]);
        (slices[1].signed, slices[1].rescale) = (true, [0.5, -1000.0]);
        slices[0].stored[5] = 0xafff;
        slices[1].stored[5] = 0xafff;
        write_series(folder.path(), &slices);
        let volume = read(folder.path()).unwrap().volume;
        assert_eq!(volume.at([1, 1, 0]), 2.0 * 4095.0 - 1024.0, "{syntax}");
        assert_eq!(volume.at([1, 1, 1]), -0.5 - 1000.0, "{syntax}");
    }
}

/// Integers take 16 bits as long as all of them fit; if one slice does not, no value is lost.
#[test]
fn values_are_kept_in_16_bits_where_these_hold_them() {
    for (rescale, whole) in [
        ([1.0, -24.0], true),
        ([1.0, 32_000.0], false), // 1023 stored is too large
        ([1.0, 0.5], false),
        ([0.5, 0.0], false),
        ([2.0, 0.0], false),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let mut slices = axial_stack(&[0.0, 2.0]);
        slices[1].rescale = rescale;
        slices[1].stored[11] = 1023;
        write_series(folder.path(), &slices);
        let volume = read(folder.path()).unwrap().volume;
        let is_whole = matches!(volume.values(), Values::I16(_));
        assert_eq!(is_whole, whole, "{rescale:?}");
        let stored = slices
            .iter()
            .flat_map(|s| s.stored.iter().map(move |&v| (s, v)));
        let expected = stored.map(|(slice, v)| {
            (slice.rescale[0] * f64::from(v.cast_signed()) + slice.rescale[1]) as f32
        });
        assert_eq!(*volume.hu(), expected.collect::<Vec<_>>(), "{rescale:?}");
    }
}

#[test]
fn a_tilted_gantry_is_reported_and_an_upright_one_is_not() {
    let folder = tempfile::tempdir().unwrap();
    let mut slices = axial_stack(&[0.0, 2.5, 5.0]);
    write_series(folder.path(), &slices);
    assert_eq!(codes(folder.path()), []);
    let turn = Rotation3::from_axis_angle(&Vector3::x_axis(), 16.5_f64.to_radians());
    for slice in &mut slices {
        slice.down_column = turn * Vector3::y();
    }
    write_series(folder.path(), &slices);
    assert_eq!(codes(folder.path()), [WarningCode::GantryTilt]);
}

#[test]
fn missing_slices_are_named() {
    let folder = tempfile::tempdir().unwrap();
    write_series(folder.path(), &axial_stack(&[0.0, 1.0, 2.0, 4.0, 5.0, 6.0]));
    let error = read(folder.path()).unwrap_err();
    let ReadError::UnevenSteps {
        expected_mm, gaps, ..
    } = &error
    else {
        panic!("{error}");
    };
    assert_relative_eq!(*expected_mm, 1.0, epsilon = 1e-9);
    assert_eq!(gaps.len(), 1, "{error}");
    assert_eq!(gaps[0].after_slice, 2);
    assert_relative_eq!(gaps[0].found_mm, 2.0, epsilon = 1e-9);
}

#[test]
fn positions_rounded_to_a_tenth_of_a_millimetre_pass() {
    let folder = tempfile::tempdir().unwrap();
    let rounded = (0..40).map(|k| (f64::from(k) * 6.25).round() / 10.0);
    write_series(folder.path(), &axial_stack(&rounded.collect::<Vec<_>>()));
    let spacing = read(folder.path()).unwrap().volume.grid().spacing_mm();
    assert_relative_eq!(spacing.z, 0.625, epsilon = 0.1 / 39.0);
}

#[test]
fn slices_in_one_place_are_counted() {
    let folder = tempfile::tempdir().unwrap();
    write_series(folder.path(), &axial_stack(&[0.0, 1.0, 1.0, 1.0, 2.0, 2.0]));
    match read(folder.path()).unwrap_err() {
        ReadError::SamePosition {
            slices: 3,
            total: 6,
            positions: 3,
            position_mm: [-10.0, 20.0, 1.0],
            ..
        } => {}
        error => panic!("{error}"),
    }
}

#[test]
fn slices_that_do_not_match_are_refused() {
    type Spoil = fn(&mut SliceSpec);
    let cases: [(&str, Spoil); 3] = [
        ("the image size", |s| {
            (s.size, s.stored) = ([2, 3], vec![0; 6]);
        }),
        ("the pixel spacing", |s| s.spacing_mm = [0.75, 0.5]),
        ("the orientation", |s| s.along_row = -Vector3::x()),
    ];
    for (expected, spoil) in cases {
        let folder = tempfile::tempdir().unwrap();
        let mut slices = axial_stack(&[0.0, 1.0, 2.0]);
        spoil(&mut slices[1]);
        write_series(folder.path(), &slices);
        match read(folder.path()).unwrap_err() {
            ReadError::Mixed { what, .. } => assert_eq!(what, expected),
            error => panic!("{error}"),
        }
    }
}

#[test]
fn localizers_and_reports_are_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let mut slices = axial_stack(&[0.0, 1.0, 2.0, 50.0]);
    slices[3].image_type = "ORIGINAL\\PRIMARY\\LOCALIZER";
    slices[3].series = 1;
    slices[3].along_row = Vector3::z();
    write_series(folder.path(), &slices);
    std::fs::write(folder.path().join("notes.txt"), "not DICOM").unwrap();
    let scan = read(folder.path()).unwrap();
    assert_eq!(scan.series[0].slices, 3);
    assert_eq!(codes(folder.path()), [WarningCode::LocalizersDropped]);

    slices[3].image_type = "DERIVED\\SECONDARY";
    write_series(folder.path(), &slices);
    let choose = |text: &str| {
        let series = Some(text.parse().unwrap());
        let options = ReadOptions {
            series,
            ..ReadOptions::default()
        };
        read_with(folder.path(), &options)
    };
    let chosen = choose("3").unwrap();
    assert_eq!(chosen, choose("2.25.3").unwrap());
    assert_eq!(chosen.volume, scan.volume);
    let listed = chosen.series.iter().map(|s| (s.number, s.slices, s.read));
    assert_eq!(
        listed.collect::<Vec<_>>(),
        [(Some(1), 1, false), (Some(3), 3, true)]
    );
    assert!(!format!("{chosen:?}").contains("2.25"));
    assert_eq!(choose("1").unwrap().volume.grid().size(), [4, 3, 1]);
    for missing in ["2", "2.25.33"] {
        let error = choose(missing).unwrap_err();
        assert!(
            matches!(&error, ReadError::NoSuchSeries { series, .. } if series.len() == 2),
            "{error}"
        );
    }
    assert!("Planted^Name".parse::<SeriesChoice>().is_err());

    let error = read(folder.path()).unwrap_err();
    let text = error.to_string();
    assert!(
        text.contains("number 1 (CT, 1 image of 4 x 3); number 3 (CT, 3 images of 4 x 3)"),
        "{text}"
    );
}

#[test]
fn a_series_in_a_subfolder_is_found() {
    let folder = tempfile::tempdir().unwrap();
    let below = folder.path().join("exam/series");
    std::fs::create_dir_all(&below).unwrap();
    std::fs::write(folder.path().join("LICENSE"), "free").unwrap();
    write_series(&below, &axial_stack(&[0.0, 1.0, 2.0]));
    assert_eq!(read(folder.path()).unwrap(), read(&below).unwrap());
}

#[test]
fn other_modalities_are_refused_unless_forced() {
    let folder = tempfile::tempdir().unwrap();
    let mut slices = axial_stack(&[0.0, 1.0]);
    slices.iter_mut().for_each(|s| s.modality = "MR");
    write_series(folder.path(), &slices);
    match read(folder.path()).unwrap_err() {
        ReadError::NotCt { modality, .. } => assert_eq!(modality, "MR"),
        error => panic!("{error}"),
    }
    let force = ReadOptions {
        force: true,
        ..ReadOptions::default()
    };
    let forced = read_with(folder.path(), &force).unwrap();
    assert_eq!(forced.modality.as_deref(), Some("MR"));
    assert_eq!(forced.warnings[0].code, WarningCode::NotCt);
}

#[test]
fn identifiers_stay_behind() {
    let folder = tempfile::tempdir().unwrap();
    write_series(folder.path(), &axial_stack(&[0.0, 1.0]));
    let scan = read(folder.path()).unwrap();
    let copy = folder.path().join("copy.nii");
    ppa_ct::write_nifti(&copy, &scan.volume).unwrap();
    let mut outputs = format!("{scan:?}") + &serde_json::to_string(&Info::of(&scan)).unwrap();
    outputs += &String::from_utf8_lossy(&std::fs::read(copy).unwrap());
    for planted in ["Planted", "PLANTED", "planted", "2.25"] {
        assert!(!outputs.contains(planted), "{planted} in {outputs}");
    }
}

#[test]
fn a_cut_file_is_an_error_at_every_length() {
    let folder = tempfile::tempdir().unwrap();
    let whole = folder.path().join("whole");
    SliceSpec::axial([4, 3], 0.0, |i, _| i as i16 - 1000).write(&whole);
    let bytes = std::fs::read(&whole).unwrap();
    let cut = folder.path().join("cut.dcm");
    for length in 0..bytes.len() {
        std::fs::write(&cut, &bytes[..length]).unwrap();
        assert!(read(&cut).is_err(), "{length} of {} bytes", bytes.len());
    }
}

/// Facts are kept; of identifying attributes only the names.
#[test]
fn the_acquisition_is_reported_without_a_value_that_identifies() {
    let folder = tempfile::tempdir().unwrap();
    let mut slices = axial_stack(&[0.0, 2.0]);
    slices[1].bits_stored = 12;
    write_series(folder.path(), &slices);
    let stated = read(folder.path()).unwrap().acquisition;
    assert_eq!(stated.slice_thickness_mm, Some(9.5));
    assert_eq!(stated.representable_hu, Some([-2048.0, 2047.0]));
    let expected = [
        "PatientID",
        "PatientName",
        "SeriesDescription",
        "SeriesInstanceUID",
    ];
    let found = stated.identifiers.iter().copied().collect::<Vec<_>>();
    assert_eq!(found, expected);
    let text = serde_json::to_string(&stated).unwrap().to_lowercase();
    assert!(!text.contains("planted"), "{text}");
}
