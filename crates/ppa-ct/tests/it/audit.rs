//! The import audit on volumes whose oddities were put there, and on real scans.

use nalgebra::{Matrix3, Point3, Rotation3, Vector3};
use ppa_ct::audit::{Audit, FindingCode, Severity};
use ppa_ct::{Acquisition, Grid, Scan, Volume, WarningCode};

use FindingCode::*;

use crate::real::data;

/// A leg of 90 mm diameter with a bone of 30 mm along z in air, 2 mm voxels, 160 x 160 x 60 mm;
/// noise of a few HU, the same everywhere.
struct Leg {
    centre: [f64; 2],
    couch_y: Option<f64>,
    length: [f64; 2],
    plate_hu: f32,
    change: fn(f32) -> f32,
    acquisition: Acquisition,
    direction: Matrix3<f64>,
    slice_mm: f64,
}

impl Default for Leg {
    fn default() -> Self {
        Self {
            centre: [80.0, 70.0],
            couch_y: None,
            length: [-1.0, 61.0],
            plate_hu: 400.0,
            change: |hu| hu,
            acquisition: Acquisition::default(),
            direction: Matrix3::identity(),
            slice_mm: 2.0,
        }
    }
}

impl Leg {
    fn scan(self) -> Scan {
        let spacing = Vector3::new(2.0, 2.0, self.slice_mm);
        let size = [80, 80, (60.0 / self.slice_mm) as usize];
        let grid =
            Grid::from_parts(size, self.direction, spacing, Point3::new(3.0, 4.0, 5.0)).unwrap();
        let hu = (0..grid.len()).map(|n| {
            let [i, j, k] = grid.voxel(n);
            let (x, y, z) = (2.0 * i as f64, 2.0 * j as f64, self.slice_mm * k as f64);
            // A fixed pattern in place of noise: −18..=18 HU.
            let noise = ((n * 7919) % 37) as f32 - 18.0;
            let r = (x - self.centre[0]).hypot(y - self.centre[1]);
            let inside = (self.length[0]..self.length[1]).contains(&z);
            let on_couch = self.couch_y.is_some_and(|c| (y - c).abs() < 2.5);
            let hu = match r {
                r if r < 4.0 && inside => self.plate_hu.max(1000.0),
                r if r < 15.0 && inside => 800.0,
                r if r < 45.0 && inside => 45.0,
                _ if on_couch => -300.0,
                _ => -1000.0,
            };
            (self.change)(hu + noise)
        });
        let hu = hu.collect();
        Scan {
            volume: Volume::new(grid, hu).unwrap(),
            modality: Some("CT".to_owned()),
            series: Vec::new(),
            acquisition: self.acquisition,
            warnings: Vec::new(),
        }
    }

    fn audit(self) -> Audit {
        Audit::of(&self.scan())
    }

    fn codes(self) -> Vec<FindingCode> {
        self.audit().findings.iter().map(|f| f.code).collect()
    }
}

fn stated(change: impl Fn(&mut Acquisition)) -> Leg {
    let mut leg = Leg::default();
    change(&mut leg.acquisition);
    leg
}

#[test]
fn a_clean_leg_only_ends_where_the_scan_ends() {
    let audit = Leg::default().audit();
    let codes = audit.findings.iter().map(|f| f.code).collect::<Vec<_>>();
    assert_eq!(codes, [CutAtEnd]);
    assert_eq!(audit.measures.axes, "LPS");
    assert!((audit.measures.air_peak_hu.unwrap() + 1000.0).abs() < 20.0);
    assert!((audit.measures.tissue_peak_hu.unwrap() - 45.0).abs() < 20.0);
    // The cross-section: π 45² mm², but for the outline of 2 mm voxels.
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
    // The same voxels seen from another side: what was on the right is now on the left.
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
        Some((CouchMisplaced, Severity::Serious))
    );
    assert_eq!(
        with(Some(12.0), None),
        Some((CouchMisplaced, Severity::Caution))
    );
    assert_eq!(with(Some(12.0), Some("HFP")), Some((Couch, Severity::Note)));
    assert_eq!(
        with(Some(12.0), Some("HFS")),
        Some((CouchMisplaced, Severity::Serious))
    );
}

/// A copy of the chain at every column would take minutes here.
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
fn values_that_are_not_hounsfield_units_are_told() {
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
        (ShiftedValues, Severity::Serious)
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
    assert_eq!((no_air.code, no_air.severity), (NoAir, Severity::Serious));
    let empty = first(|hu| hu.min(-900.0));
    assert_eq!((empty.code, empty.severity), (NoTissue, Severity::Serious));
    let boneless = first(|hu| hu.min(120.0));
    assert_eq!(
        (boneless.code, boneless.severity),
        (NoBone, Severity::Caution)
    );
}

#[test]
fn clipping_metal_and_padding_are_told() {
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
fn slices_and_axes_are_told() {
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

/// One voxel, one value, nothing but extremes: an answer, never a panic.
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

/// What a radiographer would say of each scan, no more and no less: the cut faces and the couch
/// are those seen in its slices.
#[test]
#[ignore = "needs ../shared/data"]
fn real_scans_are_judged_as_a_radiographer_would() {
    const CUT: [FindingCode; 2] = [CutAtSide, CutAtEnd];
    const LIMB: [FindingCode; 3] = [CutAtSide, CutAtEnd, CoarseVoxels];
    const TILTED: FindingCode = Reader(WarningCode::GantryTilt);
    const NOT_HU: FindingCode = Reader(WarningCode::NotHu);
    let cases: [(&str, &str, &[&[FindingCode]]); 17] = [
        (
            "lower-leg-ankle-sts049/dicom",
            "left, anterior",
            &[&LIMB, &[Couch, Identifiers]],
        ),
        (
            "knee-calf-sts028/dicom",
            "right, anterior",
            &[&LIMB, &[Identifiers]],
        ),
        (
            "knee-calf-sts028/CT_image.nii.gz",
            "right, anterior",
            &[&LIMB],
        ),
        (
            "wrist-hand-sts019/dicom",
            "right, left, anterior",
            &[&LIMB, &[Identifiers]],
        ),
        (
            "hand-reencoded/hand_permuted_SRA.nii.gz",
            "right, left, anterior",
            &[&LIMB],
        ),
        (
            "hand-reencoded/hand_oblique.nii.gz",
            "right, left, anterior",
            &[&LIMB],
        ),
        ("hand-reencoded/hand.mha", "right, left, anterior", &[&LIMB]),
        (
            "hand-reencoded/dicom-j2k",
            "right, left, anterior",
            &[&LIMB, &[Identifiers]],
        ),
        (
            "calf-couch-sts025/CT_image.nii.gz",
            "left, anterior",
            &[&LIMB, &[Couch]],
        ),
        (
            "two-calves-sts032/CT_image.nii.gz",
            "right, left",
            &[&LIMB, &[Couch]],
        ),
        ("knee-sts042/CT_image.nii.gz", "right, posterior", &[&LIMB]),
        (
            "pelvis-metal-int32/example_ct.nii.gz",
            "right, left",
            &[&CUT, &[Couch, Metal]],
        ),
        (
            "lung-mha/3DCT_lung.mha",
            "right, left, anterior, posterior",
            &[&CUT],
        ),
        // Both arms reach the circle that was reconstructed.
        (
            "abdomen-arms-j2k/dicom",
            "edge",
            &[&CUT, &[Couch, OverlappingSlices, Identifiers]],
        ),
        (
            "head-phantom-tilt/dicom",
            "",
            &[&[TILTED, CutAtEnd, Identifiers]],
        ),
        (
            "head-phantom-oblique-nifti/CT_pitch.nii.gz",
            "",
            &[&[NOT_HU, NoAir, Identifiers]],
        ),
        (
            "geometry-only-noise/gantry-tilt",
            "",
            &[&[TILTED, NoTissue, AirOffScale, CoarseVoxels, Identifiers]],
        ),
    ];
    for (path, sides, expected) in cases {
        let scan = ppa_ct::read(&data(path)).unwrap();
        let audit = Audit::of(&scan);
        let side = audit.findings.iter().find(|f| f.code == CutAtSide);
        let told = side.map_or("", |f| f.text.split_once(": ").unwrap().1);
        let faces = told.split(", ").map(|face| face.split(' ').next().unwrap());
        assert_eq!(faces.collect::<Vec<_>>().join(", "), sides, "{path}");
        let mut expected = expected.concat();
        let mut found = audit.findings.iter().map(|f| f.code).collect::<Vec<_>>();
        for codes in [&mut found, &mut expected] {
            codes.sort_by_key(|code| format!("{code:?}"));
        }
        assert_eq!(found, expected, "{path}: {:#?}", audit.findings);
    }
}
