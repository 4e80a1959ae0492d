//! The import audit on volumes with known oddities.

use nalgebra::{Matrix3, Point3, Rotation3, Vector3};
use ppa_ct::audit::{Audit, FindingCode, Severity};
use ppa_ct::{Acquisition, Grid, Scan, Volume, WarningCode};

use FindingCode::*;

use crate::audit_leg::{Leg, stated};

#[test]
fn a_clean_leg_only_ends_where_the_scan_ends() {
    let audit = Leg::default().audit();
    let codes = audit.findings.iter().map(|f| f.code).collect::<Vec<_>>();
    assert_eq!(codes, [CutAtEnd]);
    assert_eq!(audit.measures.axes, "LPS");
    assert!((audit.measures.air_peak_hu.unwrap() + 1000.0).abs() < 20.0);
    assert!((audit.measures.tissue_peak_hu.unwrap() - 45.0).abs() < 20.0);
    // The cross-section: π 45² mm², apart from the outline of 2 mm voxels.
    assert!((audit.measures.cut_cm2.superior - 63.6).abs() < 3.0);
    assert!((audit.measures.bone_cm3 - 42.4).abs() < 3.0);
    let inside = Leg {
        length: [10.0, 50.0],
        ..Leg::default()
    };
    assert_eq!(inside.codes(), []);
}

#[test]
fn cut_faces_are_named_by_the_body_and_measured() {
    for (centre, face) in [
        ([20.0, 70.0], "right"),
        ([140.0, 70.0], "left"),
        ([80.0, 20.0], "anterior"),
        ([80.0, 140.0], "posterior"),
    ] {
        let audit = Leg {
            centre,
            length: [10.0, 50.0],
            ..Leg::default()
        }
        .audit();
        let finding = &audit.findings[0];
        assert_eq!(finding.code, CutAtSide);
        assert!(finding.text.contains(face), "{}", finding.text);
        let cut = audit.measures.cut_cm2;
        let areas = [cut.right, cut.left, cut.anterior, cut.posterior];
        // A chord 20 mm from the axis, 40 mm high: 2 · √(45² − 20²) · 40 mm².
        let largest = areas.iter().fold(0.0_f64, |a, b| a.max(*b));
        assert!((largest - 32.2).abs() < 2.0, "{areas:?}");
        assert_eq!(areas.iter().filter(|a| **a > 0.0).count(), 1);
    }
    // The same voxels viewed from another side: what was on the right is now on the left.
    let turned = Leg {
        centre: [20.0, 70.0],
        direction: *Rotation3::from_axis_angle(&Vector3::z_axis(), std::f64::consts::PI).matrix(),
        ..Leg::default()
    };
    let audit = turned.audit();
    assert_eq!(audit.measures.axes, "RAS");
    assert!(
        audit.findings[0].text.contains("left"),
        "{}",
        audit.findings[0].text
    );
}

#[test]
fn a_round_field_of_view_that_cuts_the_leg_is_seen() {
    let scan = |centre| {
        let scan = Leg {
            centre,
            ..Leg::default()
        }
        .scan();
        let grid = scan.volume.grid().clone();
        let round = (0..grid.len()).map(|n| {
            let [i, j, _] = grid.voxel(n);
            let r = (i as f64 - 39.5).hypot(j as f64 - 39.5);
            if r < 40.0 {
                scan.volume.hu()[n]
            } else {
                -1024.0
            }
        });
        let volume = Volume::new(grid.clone(), round.collect()).unwrap();
        Audit::of(&Scan { volume, ..scan })
    };
    let whole = scan([79.0, 79.0]);
    assert_eq!(whole.measures.cut_by_circle_cm2, 0.0);
    let cut = scan([35.0, 35.0]);
    assert!(
        cut.measures.cut_by_circle_cm2 > 10.0,
        "{}",
        cut.measures.cut_by_circle_cm2
    );
    assert!(
        cut.findings
            .iter()
            .any(|f| f.code == CutAtSide && f.text.contains("round"))
    );
}

#[test]
fn a_couch_is_found_where_it_is() {
    let with = |couch_y, position: Option<&str>| {
        let mut leg = Leg {
            couch_y,
            ..Leg::default()
        };
        leg.acquisition.patient_position = position.map(str::to_owned);
        let audit = leg.audit();
        let mut codes = audit.findings.iter().map(|f| (f.code, f.severity));
        codes.find(|(code, _)| matches!(code, Couch | CouchMisplaced))
    };
    assert_eq!(with(None, None), None);
    assert_eq!(with(Some(130.0), None), Some((Couch, Severity::Note)));
    assert_eq!(
        with(Some(130.0), Some("FFS")),
        Some((Couch, Severity::Note))
    );
    assert_eq!(
        with(Some(130.0), Some("FFP")),
        Some((CouchMisplaced, Severity::Severe))
    );
    assert_eq!(
        with(Some(12.0), None),
        Some((CouchMisplaced, Severity::Caution))
    );
    assert_eq!(with(Some(12.0), Some("HFP")), Some((Couch, Severity::Note)));
    assert_eq!(
        with(Some(12.0), Some("HFS")),
        Some((CouchMisplaced, Severity::Severe))
    );
}

/// Copying the chain at every column would take minutes here.
#[test]
fn the_couch_is_looked_for_in_time_that_grows_with_the_image() {
    let grid = Grid::axis_aligned(
        [200_000, 3, 1],
        Vector3::new(2.0, 2.0, 2.0),
        Point3::origin(),
    );
    let row = [-1000.0_f32, 100.0, -1000.0];
    let hu = row
        .into_iter()
        .flat_map(|hu| std::iter::repeat_n(hu, 200_000))
        .collect();
    let mut scan = Leg::default().scan();
    scan.volume = Volume::new(grid.unwrap(), hu).unwrap();
    let start = std::time::Instant::now();
    assert_eq!(Audit::of(&scan).measures.couch_mm, Some(400_000.0));
    assert!(start.elapsed().as_secs() < 20, "{:?}", start.elapsed());
}

#[test]
fn values_that_are_not_hounsfield_units_are_reported() {
    let first = |change: fn(f32) -> f32| {
        Leg {
            change,
            ..Leg::default()
        }
        .audit()
        .findings
        .remove(0)
    };
    let shifted = first(|hu| hu + 1024.0);
    assert_eq!(
        (shifted.code, shifted.severity),
        (ShiftedValues, Severity::Severe)
    );
    assert!(
        shifted.text.contains("1024") || shifted.text.contains("102"),
        "{}",
        shifted.text
    );
    let far = first(|hu| hu - 90.0);
    assert_eq!((far.code, far.severity), (AirOffScale, Severity::Caution));
    let slope = first(|hu| (hu + 1000.0) * 1.25 - 1000.0);
    assert_eq!(
        (slope.code, slope.severity),
        (TissueOffScale, Severity::Caution)
    );
    let no_air = first(|hu| hu.max(-400.0));
    assert_eq!((no_air.code, no_air.severity), (NoAir, Severity::Severe));
    let empty = first(|hu| hu.min(-900.0));
    assert_eq!((empty.code, empty.severity), (NoTissue, Severity::Severe));
    let boneless = first(|hu| hu.min(120.0));
    assert_eq!(
        (boneless.code, boneless.severity),
        (NoBone, Severity::Caution)
    );
}

#[test]
fn clipping_metal_and_padding_are_reported() {
    let metal = Leg {
        plate_hu: 2900.0,
        ..Leg::default()
    };
    assert_eq!(metal.codes(), [Metal, CutAtEnd]);
    let metal = Leg {
        plate_hu: 2900.0,
        ..Leg::default()
    }
    .audit()
    .measures
    .metal_cm3;
    // Nine voxels of 8 mm³ within 4 mm of the axis, in 30 slices.
    assert!((metal - 2.16).abs() < 1e-9, "{metal}");
    let clipped = Leg {
        change: |hu| hu.min(700.0),
        ..Leg::default()
    };
    assert_eq!(clipped.codes(), [ClippedAbove, CutAtEnd]);
    let twelve_bit = Leg {
        change: |hu| if hu > 1015.0 { 3071.0 } else { hu },
        ..stated(|a| a.representable_hu = Some([-1024.0, 3071.0]))
    };
    assert!(twelve_bit.codes().contains(&ClippedAbove));
    // Metal beyond 12 bits, cut at 11 600 HU and as it is.
    let beyond = |change: fn(f32) -> f32| {
        let metal = Leg {
            plate_hu: 2900.0,
            change,
            ..Leg::default()
        };
        metal.codes().contains(&ClippedAbove)
    };
    assert!(beyond(|hu| if hu > 2000.0 {
        (4.0 * hu).min(11_600.0)
    } else {
        hu
    }));
    assert!(!beyond(|hu| if hu > 2000.0 { 4.0 * hu } else { hu }));
    let cut_below = Leg {
        change: |hu| hu.max(-880.0),
        ..Leg::default()
    };
    assert!(cut_below.codes().contains(&ClippedBelow));
    let padded = Leg {
        change: |hu| if hu < -990.0 { -3024.0 } else { hu },
        ..Leg::default()
    };
    assert!(padded.codes().contains(&BelowAir));
}

#[test]
fn slices_and_axes_are_reported() {
    let thick = |mm: f64| stated(move |a| a.slice_thickness_mm = Some(mm)).codes();
    assert_eq!(thick(2.0), [CutAtEnd]);
    assert_eq!(thick(1.25), [GapsBetweenSlices, CutAtEnd]);
    assert_eq!(thick(3.0), [OverlappingSlices, CutAtEnd]);
    let coarse = |slice_mm| {
        let audit = Leg {
            slice_mm,
            ..Leg::default()
        }
        .audit();
        audit
            .findings
            .iter()
            .find(|f| f.code == CoarseVoxels)
            .map(|f| f.severity)
    };
    assert_eq!(coarse(2.0), None);
    assert_eq!(coarse(4.0), Some(Severity::Note));
    assert_eq!(coarse(6.0), Some(Severity::Caution));
    let mirrored = Leg {
        direction: Matrix3::from_diagonal(&Vector3::new(-1.0, 1.0, 1.0)),
        ..Leg::default()
    };
    let audit = mirrored.audit();
    assert_eq!(audit.measures.axes, "RPS");
    assert!(
        audit
            .findings
            .iter()
            .any(|f| f.code == LeftHanded && f.severity == Severity::Note)
    );
    let mut leaning = Matrix3::identity();
    leaning.set_column(2, &Vector3::new(0.0, 0.28, 0.96));
    let tilted = Leg {
        direction: leaning,
        ..Leg::default()
    };
    assert!(tilted.codes().contains(&Reader(WarningCode::GantryTilt)));
    assert!(stated(|a| a.lossy = true).codes().contains(&LossyPixels));
}

#[test]
fn identifiers_are_listed_by_name() {
    let audit = stated(|a| a.identifiers = ["PatientName", "StudyDate"].into()).audit();
    let finding = audit
        .findings
        .iter()
        .find(|f| f.code == Identifiers)
        .unwrap();
    assert!(
        finding.text.contains("PatientName, StudyDate"),
        "{}",
        finding.text
    );
    let json = serde_json::to_value(finding).unwrap();
    assert_eq!(json["code"], "identifiers");
    assert_eq!(json["severity"], "note");
    let reader = serde_json::to_value(Reader(WarningCode::GantryTilt)).unwrap();
    assert_eq!(reader, "gantry-tilt");
}

/// One voxel, constant values, only extreme values: no panic.
#[test]
fn odd_volumes_are_audited() {
    for size in [[1, 1, 1], [1, 50, 1], [3, 1, 200], [64, 64, 1]] {
        for hu in [0.0, -1000.0, -32768.0, 3e9, -3e38_f32, f32::MAX] {
            let grid = Grid::axis_aligned(size, Vector3::repeat(0.7), Point3::origin()).unwrap();
            let volume = Volume::new(grid.clone(), vec![hu; grid.len()]).unwrap();
            let scan = Scan {
                volume,
                modality: None,
                series: Vec::new(),
                acquisition: Acquisition::default(),
                warnings: Vec::new(),
            };
            let audit = Audit::of(&scan);
            assert!(!audit.findings.is_empty());
        }
    }
}
