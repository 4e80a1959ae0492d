//! The import audit on real scans.

use ppa_ct::WarningCode;
use ppa_ct::audit::{Audit, FindingCode};

use FindingCode::*;

use crate::real::data;

/// Each scan gives exactly the findings that a radiographer would report: the cut faces and the couch
/// are those visible in its slices.
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
        // Both arms reach the edge of the reconstruction circle.
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
        let report = side.map_or("", |f| f.text.split_once(": ").unwrap().1);
        let faces = report
            .split(", ")
            .map(|face| face.split(' ').next().unwrap());
        assert_eq!(faces.collect::<Vec<_>>().join(", "), sides, "{path}");
        let mut expected = expected.concat();
        let mut found = audit.findings.iter().map(|f| f.code).collect::<Vec<_>>();
        for codes in [&mut found, &mut expected] {
            codes.sort_by_key(|code| format!("{code:?}"));
        }
        assert_eq!(found, expected, "{path}: {:#?}", audit.findings);
    }
}
