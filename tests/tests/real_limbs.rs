//! Real scans from `../shared/data`, through all stages.

use std::path::{Path, PathBuf};

use ppa_ct::read;
use ppa_dataset::layout::{self, LimbId, View};
use ppa_dataset::{BodyShape, FileKind, Finding, FindingCode, Manifest};
use ppa_depth::DepthImage;
use ppa_generate::{
    Case, GenerateError, Plan, PlanCase, PoseError, PreparedLimb, generate, prepare,
};
use ppa_mesh::LimbSettings;
use ppa_scene::{LandmarkOverrides, LimbKind, Side, Sweep};

fn data(name: &str) -> PathBuf {
    let shared = match std::env::var_os("PPA_SHARED") {
        Some(folder) => PathBuf::from(folder),
        None => Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared"),
    };
    shared.join("data").join(name)
}

fn prepared(scan: &Path, side: Side, limb: LimbKind) -> (Case, PreparedLimb) {
    let surface = LimbSettings::default();
    let choices = LandmarkOverrides {
        limb: Some(limb),
        ..LandmarkOverrides::default()
    };
    prepare(scan, &Default::default(), side, &surface, &choices).unwrap()
}

/// Two poses of a case with coarse radiographs.
fn plan(case: &Case, folder: &Path) -> Plan {
    let file = folder.join("case.toml");
    case.write(&file).unwrap();
    let mut plan = Plan::new(vec![PlanCase { file, patient: 0 }]);
    plan.rotation = Sweep {
        from_deg: 0.0,
        to_deg: 20.0,
        step_deg: 20.0,
    };
    plan.xray.detector.columns = 112;
    plan.xray.detector.rows = 112;
    plan.xray.detector.pixel_mm = 2.0;
    plan.xray.engine.scatter_histories = 50_000;
    plan
}

/// A dataset of these poses in its own folder, although the field of view cuts foot or kneecap.
fn dataset(case: &Case) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let mut plan = plan(case, folder.path());
    plan.depth.max_cut_share = 1.0;
    plan.xray.max_cut_share = 1.0;
    generate(
        &plan,
        &folder.path().join("data"),
        &Default::default(),
        &|_| {},
    )
    .unwrap();
    folder
}

/// The left calf is mostly outside the image, so the right one is taken for either side, without the other; for the left
/// side this is a finding.
#[test]
#[ignore = "needs ../shared/data"]
fn the_whole_calf_of_sts032_is_taken_with_a_finding() {
    let scan = data("two-calves-sts032/CT_image.nii.gz");
    for (side, doubts) in [(Side::Right, 0), (Side::Left, 1)] {
        let (case, limb) = prepared(&scan, side, LimbKind::Other);
        let found = case.found.as_ref().unwrap();
        let litres = 1e-6 * found.surface.limb_mm3;
        assert!((1.5..1.6).contains(&litres), "{side:?}: {litres} litres");
        let end = (limb.limb.mesh.vertices.iter()).fold(f32::MIN, |end, v| end.max(v.x));
        // By eye, the calves touch where x is about 4 mm.
        assert!(end < 8.0, "{side:?}: the limb reaches to x = {end} mm");
        let neighbours = found
            .findings
            .iter()
            .filter(|finding| finding.text.contains("patient's left"));
        assert_eq!(neighbours.count(), doubts, "{side:?}: {:?}", found.findings);
    }
}

/// The ankle is where a person sees it (slice 20, z = 201 mm), a couch was cut away, and the other leg, with bones around
/// x = 52 mm, is removed.
#[test]
#[ignore = "needs ../shared/data"]
fn the_right_leg_of_sts049_is_freed_from_couch_and_other_leg() {
    let scan = data("lower-leg-ankle-sts049");
    let (case, limb) = prepared(&scan, Side::Right, LimbKind::LowerLeg);
    let found = case.found.as_ref().unwrap();
    let [x, _, z] = found.landmarks.joint_centre;
    assert_eq!(found.landmarks.limb, LimbKind::LowerLeg);
    assert!((z - 201.3).abs() < 5.0, "joint at z = {z} mm");
    assert!((x + 44.0).abs() < 8.0, "joint at x = {x} mm");
    assert!(found.surface.couch_voxels > 10_000, "a couch was found");
    let right_end = limb
        .limb
        .mesh
        .vertices
        .iter()
        .map(|v| v.x)
        .fold(f32::MIN, f32::max);
    assert!(right_end < 40.0, "the limb reaches to x = {right_end} mm");

    let made = dataset(&case);
    let manifest = Manifest::read(&made.path().join("data")).unwrap();
    let kinds = [(FileKind::Depth, 20), (FileKind::Radiograph, 2)];
    for (kind, expected) in kinds {
        let found = manifest.files.iter().filter(|row| row.kind == kind).count();
        assert_eq!(found, expected, "{kind:?}");
    }
}

/// DICOM and NIfTI of one knee give the same voxels, the same case and the same depth images.
#[test]
#[ignore = "needs ../shared/data"]
fn both_containers_of_sts028_give_the_same_images() {
    let scans = [
        data("knee-calf-sts028/dicom"),
        data("knee-calf-sts028/CT_image.nii.gz"),
    ];
    let volumes = scans.each_ref().map(|scan| read(scan).unwrap().volume);
    assert!(volumes[0].hu() == volumes[1].hu());
    let made = scans
        .each_ref()
        .map(|scan| dataset(&prepared(scan, Side::Left, LimbKind::Knee).0));
    let limb = LimbId {
        patient: 0,
        side: layout::Side::Left,
    };
    for view in View::ALL {
        let file = limb.depth(BodyShape::Orig, view, 40);
        let [dicom, nifti] = made
            .each_ref()
            .map(|folder| DepthImage::read_png(&folder.path().join("data").join(&file)).unwrap());
        // The affines differ by rounding: a silhouette may move by a pixel, a depth by 1 mm.
        let pairs = dicom.z_mm.iter().zip(&nifti.z_mm);
        let differ = pairs.filter(|(a, b)| (**a - **b).abs() > 1.0).count();
        assert!(differ < 50, "{differ} pixels differ in {file}");
    }
}

/// The front face of the field of view cuts the forefoot of one limb and the kneecap of the other, within the cameras' view of the joint.
#[test]
#[ignore = "needs ../shared/data"]
fn cuts_of_sts049_and_sts028_are_refused_and_reported() {
    let scans = [
        ("lower-leg-ankle-sts049", Side::Right, LimbKind::LowerLeg),
        (
            "knee-calf-sts028/CT_image.nii.gz",
            Side::Left,
            LimbKind::Knee,
        ),
    ];
    for (scan, side, kind) in scans {
        let (case, limb) = prepared(&data(scan), side, kind);
        let front = |finding: &&Finding| {
            finding.code == FindingCode::CutLimb && finding.text.contains("-j")
        };
        assert_eq!(
            limb.findings.iter().filter(front).count(),
            1,
            "{scan}: {:?}",
            limb.findings
        );
        let folder = tempfile::tempdir().unwrap();
        let plan = plan(&case, folder.path());
        let root = folder.path().join("data");
        let error = generate(&plan, &root, &Default::default(), &|_| {}).unwrap_err();
        let GenerateError::Posable {
            source: PoseError::Cut(cut),
            ..
        } = error
        else {
            panic!("{scan}: {error:?}")
        };
        println!("{scan}: {cut}");
        assert!((0.01..0.5).contains(&cut.worst[0].share), "{scan}: {cut}");
    }
}
