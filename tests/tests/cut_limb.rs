//! A leg whose foot is cut by the field of view within the regions of interest, through all stages.

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use ppa_dataset::layout::{self, LimbId, View};
use ppa_dataset::{BodyShape, FileKind, FindingCode, Findings, Manifest, Severity};
use ppa_depth::{DepthImage, WallDepth};
use ppa_generate::{
    GenerateError, Plan, PlanCase, PoseError, PoseImage, forecast, generate, prepare,
};
use ppa_mesh::{LimbSettings, VoxelBox};
use ppa_phantom::{LowerLeg, TableTop};
use ppa_scene::{Side, Sweep};

const LIMB: LimbId = LimbId {
    patient: 0,
    side: layout::Side::Right,
};

/// A plan of one pose of the phantom's case, whole or (`cut`) with the front 20 mm of its scan and most of the foot cropped away.
fn plan(folder: &Path, cut: bool) -> Plan {
    let scan = folder.join("leg.nii.gz");
    let volume = LowerLeg::p01().voxelise(2.0, TableTop::Absent).unwrap();
    ppa_ct::write_nifti(&scan, &volume).unwrap();
    let size = volume.grid().size();
    // Patients lie on their back: y points down, and the toes have the smallest y.
    let crop = VoxelBox {
        low: [0, size[1] * 11 / 20, 0],
        high: size,
    };
    let surface = LimbSettings {
        crop: cut.then_some(crop),
        ..LimbSettings::default()
    };
    let (case, prepared) = prepare(
        &scan,
        &Default::default(),
        Side::Right,
        &surface,
        &Default::default(),
    )
    .unwrap();
    let cautions: Vec<_> = prepared
        .findings
        .iter()
        .filter(|f| f.code == FindingCode::CutLimb)
        .collect();
    assert_eq!(cautions.len(), usize::from(cut), "{:?}", prepared.findings);
    if let [front] = cautions[..] {
        let reported = prepared
            .limb
            .report
            .cut_faces
            .iter()
            .find(|cut| cut.face == "-j")
            .unwrap();
        assert_eq!(front.severity, Severity::Caution);
        assert!(
            (front.value.unwrap() / reported.area_mm2 - 1.0).abs() < 0.1,
            "{front:?}"
        );
    }
    let file = folder.join("leg.toml");
    case.write(&file).unwrap();
    let mut plan = Plan::new(vec![PlanCase { file, patient: 0 }]);
    plan.rotation = Sweep {
        from_deg: 10.0,
        to_deg: 10.0,
        step_deg: 1.0,
    };
    plan.shapes.variants = vec![BodyShape::Orig, BodyShape::Big];
    plan.xray.detector.columns = 56;
    plan.xray.detector.rows = 56;
    plan.xray.detector.pixel_mm = 4.0;
    plan.xray.engine.scatter_histories = 20_000;
    plan
}

fn made(plan: &Plan, root: PathBuf) -> Manifest {
    generate(plan, &root, &Default::default(), &|_| {}).unwrap();
    Manifest::read(&root).unwrap()
}

fn depth(manifest: &Manifest, shape: BodyShape, view: View) -> (DepthImage, Option<f64>) {
    let file = LIMB.depth(shape, view, 20);
    let row = manifest.files.iter().find(|row| row.file == file).unwrap();
    (
        DepthImage::read_png(&manifest.root.join(file)).unwrap(),
        row.cut_share,
    )
}

#[test]
fn a_foot_cut_in_the_region_needs_the_plans_consent() {
    let folder = tempfile::tempdir().unwrap();
    let mut plan = plan(folder.path(), true);
    let refused = |plan: &Plan| {
        let root = folder.path().join("refused");
        let error = generate(plan, &root, &Default::default(), &|_| {}).unwrap_err();
        let GenerateError::Posable {
            source: PoseError::Cut(cut),
            ..
        } = &error
        else {
            panic!("{error:?}")
        };
        assert_eq!(cut.limb, LIMB);
        assert!(!root.join("patient_0").exists(), "nothing was begun");
        assert!(
            forecast(plan, &root, 0.0, &AtomicBool::new(false), &|_| {}).is_err(),
            "a plan is refused as early"
        );
        let worst = cut.worst.iter();
        assert!(worst.clone().all(|w| (w.exceeding, w.poses) == (1, 1)));
        let worst: Vec<_> = worst.map(|w| (w.image, w.share)).collect();
        (worst, cut.to_string())
    };
    let (worst, said) = refused(&plan);
    let [
        (PoseImage::Depth(_), share),
        (PoseImage::Radiograph, of_rays),
    ] = worst[..]
    else {
        panic!("{worst:?}")
    };
    assert!(said.contains("depth.max_cut_share") && said.contains("xray.max_cut_share"));
    plan.xray.max_cut_share = of_rays;
    assert_eq!(refused(&plan).0, worst[..1]);
    assert!((0.01..0.3).contains(&share), "{share}");
    plan.depth.max_cut_share = share;

    let invalid = made(&plan, folder.path().join("invalid"));
    plan.depth.cut_faces = WallDepth::Flat;
    let flat = made(&plan, folder.path().join("flat"));
    let mut worst: f64 = 0.0;
    for view in View::ALL {
        let (none, cut) = depth(&invalid, BodyShape::Orig, view);
        let (wall, same) = depth(&flat, BodyShape::Orig, view);
        assert_eq!(cut, same);
        worst = worst.max(cut.unwrap());
        let rois = invalid.rois(LIMB).unwrap();
        let roi = &rois[&LimbId::depth_name(view, 20)];
        // Pixels differ only where the cut is invalid in one image and a surface in the other.
        let differ = |pixel: &u32| none.z_mm[*pixel as usize] != wall.z_mm[*pixel as usize];
        let pixels = (0..none.z_mm.len() as u32).filter(differ);
        let (mut inside, mut all) = (0, 0);
        for pixel in pixels {
            let at = pixel as usize;
            assert!(none.z_mm[at] == 0.0 && wall.z_mm[at] > 500.0);
            let (column, row) = (pixel % none.width, pixel / none.width);
            let within = |start: u32, at: u32| (start..start + roi.size).contains(&at);
            inside += usize::from(within(roi.x_start, column) && within(roi.y_start, row));
            all += 1;
        }
        assert!(all >= inside);
        let counted = inside as f64 / f64::from(roi.size).powi(2);
        assert!((counted - cut.unwrap()).abs() < 1e-12, "{counted} {cut:?}");
        let (_, of_big) = depth(&flat, BodyShape::Big, view);
        assert!(
            of_big.unwrap() > cut.unwrap(),
            "the wall of a thicker limb is larger"
        );
    }
    assert_eq!(worst, share);
    let radiographs = invalid
        .files
        .iter()
        .filter(|row| row.kind != FileKind::Depth);
    assert!(
        radiographs
            .into_iter()
            .all(|row| row.cut_share == Some(of_rays))
    );

    let findings = Findings::read(&invalid.root).unwrap();
    let severe: Vec<_> = findings
        .0
        .iter()
        .filter(|f| f.finding.code == FindingCode::CutInRegion)
        .collect();
    let [found] = severe[..] else {
        panic!("{severe:?}")
    };
    assert!(found.is_open());
    let stated = found.finding.value.unwrap();
    assert!((stated - share.max(of_rays)).abs() <= 0.005, "{stated}");
}

/// A leg always ends at the end of its scan, far from the joint; this is no reason to refuse it.
#[test]
fn a_leg_cut_at_its_proximal_end_alone_has_no_share() {
    let folder = tempfile::tempdir().unwrap();
    let manifest = made(&plan(folder.path(), false), folder.path().join("data"));
    assert_eq!(manifest.files.len(), 6);
    assert!(manifest.files.iter().all(|row| row.cut_share.is_none()));
    assert_eq!(Findings::read(&manifest.root).unwrap(), Findings::default());
}
