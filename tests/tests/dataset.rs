//! All stages on a coarse phantom: geometry that must agree across crates, and a dataset that does not depend on how it was made.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::sync::atomic::AtomicBool;

use nalgebra::{Isometry3, Point3, Vector3};
use ppa_core::TransformRows;
use ppa_dataset::layout::{self, LimbId, View};
use ppa_dataset::{BodyShape, FileKind, Manifest};
use ppa_depth::{DepthImage, isometry_from_rows};
use ppa_generate::{
    Case, FolderError, GenerateError, GenerateSettings, JobError, Plan, PlanCase, PreparedLimb,
    SceneSetup, Summary, forecast, generate, prepare, verify,
};
use ppa_phantom::{LowerLeg, TableTop};
use ppa_scene::{Landmarks, Side, Sweep};
use ppa_xray::AnalogSettings;

const SPACING_MM: f64 = 2.0;

const LIMB: LimbId = LimbId {
    patient: 0,
    side: layout::Side::Right,
};

/// A folder with the phantom's scan and case, made once.
fn inputs() -> &'static Path {
    static INPUTS: OnceLock<tempfile::TempDir> = OnceLock::new();
    let folder = INPUTS.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        let scan = folder.path().join("secret-name.nii.gz");
        let volume = LowerLeg::p01()
            .voxelise(SPACING_MM, TableTop::Present)
            .unwrap();
        ppa_ct::write_nifti(&scan, &volume).unwrap();
        let (case, _) = prepare(
            &scan,
            &Default::default(),
            Side::Right,
            &Default::default(),
            &Default::default(),
        )
        .unwrap();
        case.write(&folder.path().join("p01.toml")).unwrap();
        folder
    });
    folder.path()
}

/// Two poses, all shapes, a coarse radiograph.
fn plan() -> Plan {
    let mut plan = Plan::new(vec![PlanCase {
        file: inputs().join("p01.toml"),
        patient: 0,
    }]);
    plan.seed = 7;
    plan.rotation = Sweep {
        from_deg: 0.0,
        to_deg: 18.0,
        step_deg: 18.0,
    };
    plan.xray.detector.columns = 56;
    plan.xray.detector.rows = 56;
    plan.xray.detector.pixel_mm = 4.0;
    plan.xray.engine.scatter_histories = 20_000;
    plan
}

fn run(plan: &Plan, root: &Path, threads: usize) -> Summary {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .unwrap();
    pool.install(|| generate(plan, root, &GenerateSettings::default(), &|_| {}))
        .unwrap()
}

fn replace(plan: &Plan, root: &Path, threads: usize) -> Summary {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .unwrap();
    let settings = GenerateSettings {
        replace: true,
        ..GenerateSettings::default()
    };
    pool.install(|| generate(plan, root, &settings, &|_| {}))
        .unwrap()
}

/// A dataset made once by one thread, for tests that only read it.
fn dataset() -> &'static Path {
    static DATASET: OnceLock<tempfile::TempDir> = OnceLock::new();
    let made = DATASET.get_or_init(|| {
        let root = tempfile::tempdir().unwrap();
        run(&plan(), root.path(), 1);
        root
    });
    made.path()
}

/// All files below `root` except the lock, with their bytes.
fn contents(root: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    fn walk(folder: &Path, found: &mut Vec<PathBuf>) {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                walk(&path, found);
            } else if path.file_name().unwrap() != "lock" {
                found.push(path);
            }
        }
    }
    let mut files = Vec::new();
    walk(root, &mut files);
    let relative = |path: &PathBuf| path.strip_prefix(root).unwrap().to_owned();
    files
        .iter()
        .map(|path| (relative(path), fs::read(path).unwrap()))
        .collect()
}

fn motion(rows: &TransformRows) -> Isometry3<f64> {
    isometry_from_rows(rows).unwrap()
}

#[test]
fn a_dataset_has_every_image_of_its_plan() {
    let manifest = Manifest::read(dataset()).unwrap();
    let count = |kind| manifest.files.iter().filter(|row| row.kind == kind).count();
    assert_eq!(count(FileKind::Depth), 2 * 2 * 5);
    assert_eq!(count(FileKind::Radiograph), 2);
    assert_eq!(count(FileKind::RadiographTallies), 2);
    for row in &manifest.files {
        let found = ppa_dataset::sha256_of_file(&dataset().join(&row.file)).unwrap();
        assert_eq!(found, row.sha256, "{}", row.file);
    }
    let rois = manifest.rois(LIMB).unwrap();
    assert_eq!(rois.len(), 4);
    assert_eq!(rois["depth_cam_left_18.0.png"].image_number, 36);
}

#[test]
fn analog_radiographs_are_planned_made_and_verified() {
    let mut plan = plan();
    plan.rotation.to_deg = 0.0;
    plan.shapes.variants = vec![BodyShape::Orig];
    plan.xray.analog = Some(AnalogSettings::default().with_histories(20_000));
    let folder = tempfile::tempdir().unwrap();
    let (file, root) = (folder.path().join("plan.toml"), folder.path().join("data"));
    plan.write_commented(&file).unwrap();
    assert_eq!(Plan::read(&file).unwrap().xray, plan.xray);

    let stop = AtomicBool::new(false);
    let cost = forecast(&plan, &root, 0.0, &stop, &|_| {}).unwrap();
    assert_eq!((cost.pose_jobs, cost.measured), (1, 1));
    assert_eq!(run(&plan, &root, 2).made, 1);
    assert_eq!(run(&plan, &root, 1).made, 0);
    let again = verify(&plan, &root, 1.0, 0, &stop, &|_| {}).unwrap();
    assert_eq!((again.remade, again.different), (1, Vec::new()));

    let radiograph = |root: &Path| fs::read(root.join(LIMB.radiograph_png(0))).unwrap();
    assert_ne!(radiograph(&root), radiograph(dataset()));
    // Datasets of the fast engine do not mention the analog engine.
    let names_it = |root: &Path| {
        let text = fs::read_to_string(root.join("dataset.json")).unwrap();
        text.contains("analog")
    };
    assert!(names_it(&root) && !names_it(dataset()));
}

#[test]
fn threads_do_not_change_a_byte() {
    let root = tempfile::tempdir().unwrap();
    run(&plan(), root.path(), 2);
    let (one, two) = (contents(dataset()), contents(root.path()));
    assert_eq!(
        one.keys().collect::<Vec<_>>(),
        two.keys().collect::<Vec<_>>()
    );
    for (path, bytes) in &one {
        assert!(bytes == &two[path], "{} differs", path.display());
    }
}

#[test]
fn a_run_makes_only_what_is_missing_or_damaged() {
    let root = tempfile::tempdir().unwrap();
    let made = run(&plan(), root.path(), 2).made;
    assert_eq!(made, 2);
    let first = contents(root.path());

    assert_eq!(run(&plan(), root.path(), 2).made, 0, "nothing is missing");
    let image = LIMB.depth(BodyShape::Small, View::Right, 36);
    fs::write(root.path().join(&image), b"damaged").unwrap();
    let left = root
        .path()
        .join(".ppa/new/patient_0/.depth_cam_left_0.0.png.x7Gh2k");
    fs::create_dir_all(left.parent().unwrap()).unwrap();
    fs::write(left, b"by a killed run").unwrap();
    let healed = run(&plan(), root.path(), 2);
    assert_eq!(healed.made, 1, "one pose is damaged");
    assert_eq!(healed.healed, [image]);
    fs::remove_dir_all(root.path().join(".ppa/altered")).unwrap();
    assert!(
        contents(root.path()) == first,
        "the repaired dataset is the first one"
    );

    let mut other = plan();
    other.xray.kvp = 70.0;
    let refused = generate(&other, root.path(), &GenerateSettings::default(), &|_| {}).unwrap_err();
    let said = refused.to_string();
    assert!(
        said.contains("2 of its 2 poses")
            && said.contains("settings.xray.kvp is 60.0 in the dataset and 70.0 in this run"),
        "{said}"
    );
    assert!(contents(root.path()) == first, "nothing was changed");
    assert_eq!(
        replace(&other, root.path(), 2).made,
        2,
        "all follow from the tube voltage"
    );
}

/// Replacing a plan leaves the same files as a run into an empty folder.
#[test]
fn images_of_an_earlier_plan_do_not_stay() {
    let (edited, fresh) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    run(&plan(), edited.path(), 2);
    let mut fewer = plan();
    fewer.shapes.variants = vec![BodyShape::Orig];
    replace(&fewer, edited.path(), 2);
    run(&fewer, fresh.path(), 2);
    let (edited, fresh) = (contents(edited.path()), contents(fresh.path()));
    let (edited, fresh) = (edited.iter(), fresh.iter());
    assert!(edited.eq(fresh), "the folder still shows the earlier plan");
}

#[test]
fn a_folder_of_something_else_is_refused() {
    let root = tempfile::tempdir().unwrap();
    fs::write(root.path().join("holiday.jpg"), b"dear").unwrap();
    let error = generate(&plan(), root.path(), &GenerateSettings::default(), &|_| {}).unwrap_err();
    assert!(
        matches!(
            error,
            GenerateError::Job(JobError::Folder(FolderError::NotADataset(_)))
        ),
        "{error}"
    );

    let mut shorter = plan();
    shorter.rotation.to_deg = 0.0;
    let error = generate(&shorter, dataset(), &GenerateSettings::default(), &|_| {}).unwrap_err();
    assert!(
        matches!(
            error,
            GenerateError::Job(JobError::Folder(FolderError::Differs(_)))
        ),
        "{error}"
    );
}

#[test]
fn two_cases_of_one_limb_are_refused() {
    let mut plan = plan();
    plan.cases.push(plan.cases[0].clone());
    let root = tempfile::tempdir().unwrap();
    let error = generate(
        &plan,
        &root.path().join("new"),
        &GenerateSettings::default(),
        &|_| {},
    )
    .unwrap_err();
    assert!(matches!(error, GenerateError::SameLimb { .. }), "{error}");
}

#[test]
fn no_path_of_the_scan_reaches_the_dataset() {
    for (path, bytes) in contents(dataset()) {
        let holds = |needle: &[u8]| bytes.windows(needle.len()).any(|window| window == needle);
        assert!(!holds(b"secret-name"), "{}", path.display());
        assert!(
            !holds(inputs().to_str().unwrap().as_bytes()),
            "{}",
            path.display()
        );
    }
}

/// A depth pixel, transformed through camera, room and patient into the scan, is on the phantom's analytic skin: one chain
/// through all frames.
#[test]
fn depth_pixels_lie_on_the_skin_of_the_scan() {
    let phantom = LowerLeg::p01();
    let setup = SceneSetup::of_plan(&plan()).unwrap();
    let manifest = Manifest::read(dataset()).unwrap();
    let rois = manifest.rois(LIMB).unwrap();
    let originals = manifest
        .files
        .iter()
        .filter(|row| row.kind == FileKind::Depth && row.shape == BodyShape::Orig);
    for row in originals {
        let view = row.camera.unwrap();
        let placed = setup
            .cameras
            .iter()
            .find(|camera| camera.view == view)
            .unwrap();
        let room_from_ct = motion(&row.room_from_patient) * motion(&row.patient_from_ct);
        let ct_from_camera = (placed.camera_from_room * room_from_ct).inverse();
        let image = DepthImage::read_png(&dataset().join(&row.file)).unwrap();
        let roi = &rois[&LimbId::depth_name(view, row.step)];
        let mut distances = Vec::new();
        for y in (roi.y_start..roi.y_start + roi.size).step_by(3) {
            for x in (roi.x_start..roi.x_start + roi.size).step_by(3) {
                let at = (y * image.width + x) as usize;
                let (z, empty) = (image.z_mm[at], placed.background.z_mm[at]);
                let Some(ray) = placed.camera.rays()[at] else {
                    continue;
                };
                // Where the limb hides the room by more than the rounding of the PNG.
                if z > 0.0 && (empty == 0.0 || z < empty - 3.0) {
                    let z = f64::from(z);
                    let p = ct_from_camera * Point3::new(ray.x * z, ray.y * z, z);
                    distances.push(phantom.skin_distance_mm(&p).abs());
                }
            }
        }
        assert!(
            distances.len() > 500,
            "{} pixels see the limb",
            distances.len()
        );
        distances.sort_by(f64::total_cmp);
        let median = distances[distances.len() / 2];
        let far = distances[distances.len() * 98 / 100];
        // Half a millimetre of PNG rounding, and up to half a voxel from partial volume.
        assert!(
            median < 0.5 + 0.25 * SPACING_MM,
            "median {median} mm in {}",
            row.file
        );
        assert!(
            far < 0.5 + SPACING_MM,
            "98th percentile {far} mm in {}",
            row.file
        );
    }
}

/// The central beam of every radiograph passes through the phantom's true joint, and the source rotates about the limb by
/// the angle of the pose.
#[test]
fn the_beam_passes_through_the_joint() {
    let truth = LowerLeg::p01().truth();
    let manifest = Manifest::read(dataset()).unwrap();
    let mut beams = Vec::new();
    for row in manifest
        .files
        .iter()
        .filter(|row| row.kind == FileKind::Radiograph)
    {
        let ct_from_device = motion(&row.ct_from_device.unwrap());
        let joint = ct_from_device.inverse() * truth.joint_centre;
        let aside_mm = joint.xy().coords.norm();
        assert!(
            aside_mm < 8.0,
            "the beam passes {aside_mm} mm from the joint"
        );
        beams.push(ct_from_device * Vector3::z());
    }
    let turned = beams[0].angle(&beams[1]).to_degrees();
    assert!(
        (turned - 18.0).abs() < 1.5,
        "the device turned by {turned} degrees"
    );
}

/// The choices written by `ppa prepare` give the same limb again; an edited choice gives another.
#[test]
fn choices_of_a_case_are_carried_out() {
    let case = Case::read(&inputs().join("p01.toml")).unwrap();
    let again = PreparedLimb::of_case(&case).unwrap();
    let (surface, choices) = (Default::default(), Default::default());
    let (_, first) = prepare(
        &case.source.path,
        &Default::default(),
        Side::Right,
        &surface,
        &choices,
    )
    .unwrap();
    let frame = |landmarks: &Landmarks| *landmarks.patient_from_ct().isometry();
    let moved = frame(&again.landmarks) * frame(&first.landmarks).inverse();
    assert!(moved.translation.vector.norm() < 1e-9 && moved.rotation.angle() < 1e-9);

    let mut edited = case.clone();
    let mut joint = first.landmarks.joint_centre;
    joint[2] += 10.0;
    edited.choices.joint_centre = Some(joint);
    let higher = PreparedLimb::of_case(&edited).unwrap().landmarks;
    assert_eq!(Some(higher.joint_centre), edited.choices.joint_centre);

    let mut open = case.clone();
    open.choices = Default::default();
    let found = PreparedLimb::of_case(&open).unwrap().landmarks;
    assert_eq!(found, first.landmarks);
}

/// A sensor changes depths by millimetres, with seeds in the manifest, but not the radiographs.
#[test]
fn a_sensor_disturbs_the_depth_images_and_nothing_else() {
    let mut plan = plan();
    plan.depth.sensor = Some(ppa_depth::SensorSpec::default());
    let root = tempfile::tempdir().unwrap();
    run(&plan, root.path(), 2);
    let manifest = Manifest::read(root.path()).unwrap();
    let ideal = Manifest::read(dataset()).unwrap();
    for (row, ideal) in manifest.files.iter().zip(&ideal.files) {
        assert_eq!(row.file, ideal.file);
        if row.kind != FileKind::Depth {
            assert_eq!(row.sha256, ideal.sha256);
            continue;
        }
        assert!(row.seed.is_some() && ideal.seed.is_none());
        let image = |root: &Path| DepthImage::read_png(&root.join(&row.file)).unwrap().z_mm;
        let (noisy, exact) = (image(root.path()), image(dataset()));
        let both = noisy
            .iter()
            .zip(&exact)
            .filter(|(a, b)| **a > 0.0 && **b > 0.0);
        let mut errors: Vec<f32> = both.map(|(a, b)| (a - b).abs()).collect();
        assert!(errors.len() > exact.len() / 2);
        errors.sort_unstable_by(f32::total_cmp);
        let median = errors[errors.len() / 2];
        assert!((0.5..40.0).contains(&median), "median error {median} mm");
    }
}
