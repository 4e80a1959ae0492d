//! DICOM of real scanners: tilt, gaps, encodings, and what must be refused.

use approx::assert_relative_eq;
use ppa_ct::{Info, ReadError, ReadOptions, WarningCode, read, read_with};

use crate::real::{affine, chain, codes, data, open};

#[test]
#[ignore = "needs ../shared/data"]
fn a_real_gantry_tilt_gives_the_sheared_affine() {
    let scan = open("head-phantom-tilt/dicom");
    assert_eq!(codes(&scan), [WarningCode::GantryTilt]);
    assert_eq!(scan.volume.grid().size(), [512, 512, 16]);
    let affine = affine(&scan);
    let step = affine.fixed_view::<3, 1>(0, 2);
    assert_relative_eq!(step[0], 0.0, epsilon = 1e-6);
    assert_relative_eq!(step[1], 0.0, epsilon = 1e-6);
    assert_relative_eq!(step[2], 2.5, epsilon = 1e-6);
    let lean = 16.5_f64.to_radians();
    // The cosines are written with six digits.
    assert_relative_eq!(affine[(1, 1)], 0.40625 * lean.cos(), epsilon = 1e-5);
    assert_relative_eq!(affine[(2, 1)], 0.40625 * lean.sin(), epsilon = 1e-5);
}

#[test]
#[ignore = "needs ../shared/data"]
fn what_must_be_refused_is_refused() {
    let refusal = |path: &str| read(&data(path)).expect_err(path);
    for syntax in ["j2k", "jpeg", "jpegls", "rle"] {
        let error = refusal(&format!("mr-not-ct/compressed_{syntax}"));
        assert!(
            matches!(&error, ReadError::NotCt { modality, .. } if modality == "MR"),
            "{error}"
        );
    }
    let error = refusal("geometry-only-noise/same-position");
    assert!(
        matches!(error, ReadError::SamePosition { slices: 4, .. }),
        "{error}"
    );
    for folder in ["missing-slice", "tilt-missing-slice"] {
        let error = refusal(&format!("geometry-only-noise/{folder}"));
        assert!(matches!(error, ReadError::UnevenSteps { .. }), "{error}");
    }
    let error = refusal("hand-reencoded/dicom-gaps");
    let ReadError::UnevenSteps { gaps, .. } = &error else {
        panic!("{error}");
    };
    // Slices 11, 12 and 30 are missing: the steps after slices 10 and 29 (27 of those left).
    assert_eq!(
        gaps.iter().map(|g| g.after_slice).collect::<Vec<_>>(),
        [10, 27]
    );
    assert_relative_eq!(gaps[0].found_mm, 9.81, epsilon = 1e-6);
    assert_relative_eq!(gaps[1].found_mm, 6.54, epsilon = 1e-6);
    let error = refusal("enhanced-ct-2frames/eCT_Supplemental.dcm");
    assert!(
        matches!(&error, ReadError::NotHu { unit, .. } if *unit == "ml/100ml/s"),
        "{error}"
    );
}

#[test]
#[ignore = "needs ../shared/data"]
fn what_is_refused_is_read_when_forced() {
    let force = ReadOptions {
        force: true,
        ..ReadOptions::default()
    };
    let read =
        |path: &str| read_with(&data(path), &force).unwrap_or_else(|e| panic!("{}", chain(&e)));
    let rle = read("mr-not-ct/compressed_rle");
    assert_eq!(
        codes(&rle),
        [
            WarningCode::NoRescale,
            WarningCode::NotCt,
            WarningCode::NotHu
        ]
    );
    assert_eq!(rle.volume.grid().size(), [256, 256, 4]);
    for syntax in ["j2k", "jpeg", "jpegls"] {
        let same = read(&format!("mr-not-ct/compressed_{syntax}"));
        assert_eq!(same.volume, rle.volume, "{syntax}");
    }
    let flow = read("enhanced-ct-2frames/eCT_Supplemental.dcm");
    assert_eq!(flow.volume.grid().size(), [512, 512, 2]);
    assert_eq!(codes(&flow), [WarningCode::NotHu]);
    // Rows run to the right, so slices are stacked downwards.
    assert_relative_eq!(affine(&flow)[(2, 2)], -10.0, epsilon = 1e-9);
}

#[test]
#[ignore = "needs ../shared/data"]
fn gaps_are_filled_when_asked_for() {
    let fill = ReadOptions {
        fill_gaps: true,
        ..ReadOptions::default()
    };
    let filled = read_with(&data("hand-reencoded/dicom-gaps"), &fill).unwrap();
    let whole = open("wrist-hand-sts019/dicom");
    assert_eq!(codes(&filled), [WarningCode::GapsFilled]);
    assert_eq!(filled.volume.grid().size(), whole.volume.grid().size());
    assert!((affine(&filled) - affine(&whole)).amax() < 1e-9);
    let [nx, ny, nz] = whole.volume.grid().size();
    for k in 0..nz {
        for at in [[60, 60], [40, 70], [70, 50], [nx - 1, ny - 1]] {
            let hu = |k| whole.volume.at([at[0], at[1], k]);
            let expected = match k {
                11 => hu(10) / 3.0 * 2.0 + hu(13) / 3.0,
                12 => hu(10) / 3.0 + hu(13) / 3.0 * 2.0,
                30 => (hu(29) + hu(31)) / 2.0,
                k => hu(k),
            };
            let found = filled.volume.at([at[0], at[1], k]);
            assert!((found - expected).abs() < 1e-3, "{k}: {found}, {expected}");
        }
    }
    // The lattice of a tilted gantry stays sheared.
    let tilted = read_with(&data("geometry-only-noise/tilt-missing-slice"), &fill).unwrap();
    assert_eq!(
        codes(&tilted),
        [WarningCode::GapsFilled, WarningCode::GantryTilt]
    );
    assert_eq!(tilted.volume.grid().size()[2], 5);
}

#[test]
#[ignore = "needs ../shared/data"]
fn every_encoding_of_one_slice_is_read_or_refused_by_name() {
    let reference = open(
        "one-slice-all-syntaxes/CTImage.dcm_LittleEndianExplicitTransferSyntax_1.2.840.10008.1.2.1.dcm",
    );
    let mut exact = 0;
    for entry in std::fs::read_dir(data("one-slice-all-syntaxes")).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        let Some(uid) = name.strip_suffix(".dcm").and_then(|n| n.rsplit('_').next()) else {
            continue;
        };
        // Sum and largest difference within the bore, from pydicom 3.0.2 with pylibjpeg; decoders of the discrete cosine
        // transform may differ by one stored value.
        let (sum, worst_hu, stored_hu) = match uid.trim_start_matches("1.2.840.10008.1.2.") {
            "4.50" => (-253_587_743.1, 64.3, 32.1216),
            "4.51" => (-249_051_885.8, 35.7, 2.0003),
            "4.81" => (-248_761_732.0, 1.0, 0.0),
            "4.91" => (-248_809_088.0, 5.0, 0.0),
            "4.53" | "4.55" => {
                let error = read(&path).unwrap_err();
                let retired =
                    error.to_string().contains("retired") && error.to_string().contains(uid);
                assert!(retired, "{error}");
                continue;
            }
            _ => {
                assert_eq!(read(&path).unwrap().volume, reference.volume, "{name}");
                exact += 1;
                continue;
            }
        };
        let scan = read(&path).unwrap_or_else(|e| panic!("{name}: {}", chain(&e)));
        let found = Info::of(&scan).hu_sum;
        let slack = stored_hu * 0.05 * reference.volume.hu().len() as f64 + 0.5;
        assert!((found - sum).abs() < slack, "{name}: {found}, {sum}");
        let values = [&scan, &reference].map(|s| s.volume.values().iter());
        let [found, expected] = values;
        let differences = found.zip(expected);
        // Lossy encodings do not keep the padding outside the bore.
        let inside = differences.filter(|(_, b)| *b >= -1024.0);
        let worst = inside.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(f64::from(worst) <= worst_hu + stored_hu, "{name}: {worst}");
    }
    assert_eq!(exact, 9);
}
