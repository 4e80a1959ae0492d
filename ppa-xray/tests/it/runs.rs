//! Long runs: parts, resuming, tally files and stopping criteria.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Duration;

use nalgebra::Isometry3;
use ppa_xray::{
    AnalogRun, AnalogSettings, AnalogTally, Blur, DoseSettings, Part, Progress, Projection,
    RunError, Spectrum, Stop, Stopped, TallyError, VoxelBox, VoxelPhantom, analog,
};
use proptest::prelude::*;

use crate::scenes::{frontal, limb};

struct Scene {
    phantom: VoxelPhantom,
    spectrum: Spectrum,
    projection: Projection,
}

impl Scene {
    fn new() -> Self {
        Self {
            phantom: limb(&Isometry3::identity()),
            spectrum: Spectrum::monoenergetic(55.0).unwrap(),
            projection: frontal(12, 8.0),
        }
    }

    fn run(&self, histories: u64, seed: u64) -> AnalogRun<'_> {
        let settings = settings(histories, seed);
        let dose = DoseSettings::default()
            .with_regions(vec![VoxelBox {
                low: [10, 10, 10],
                high: [20, 20, 30],
            }])
            .with_voxels(Some(VoxelBox {
                low: [12, 8, 5],
                high: [24, 20, 35],
            }));
        AnalogRun::new(&self.phantom, &self.spectrum, &self.projection, &settings)
            .unwrap()
            .with_dose(&dose)
            .unwrap()
    }

    /// Runs one part to its end and returns its file.
    fn part(&self, part: &str, histories: u64, directory: &Path) -> PathBuf {
        let run = self.run(histories, 3);
        let mut tally = run.tally(part.parse().unwrap());
        assert_eq!(
            run.follow(&mut tally, &Stop::default(), |_, _| go_on())
                .unwrap(),
            Stopped::Complete
        );
        let path = directory.join(format!("{}.tally", part.replace('/', "of")));
        tally.write(&path).unwrap();
        path
    }
}

fn settings(histories: u64, seed: u64) -> AnalogSettings {
    AnalogSettings::default()
        .with_histories(histories)
        .with_seed(seed)
}

fn go_on() -> ControlFlow<()> {
    ControlFlow::Continue(())
}

fn whole(scene: &Scene, histories: u64) -> AnalogTally {
    let run = scene.run(histories, 3);
    let mut tally = run.tally(Part::WHOLE);
    run.follow(&mut tally, &Stop::default(), |_, _| go_on())
        .unwrap();
    tally
}

/// Any partition in any order, interrupted or not, gives the same bytes as a single run.
#[test]
fn parts_merge_to_the_bytes_of_one_run() {
    let (scene, directory) = (Scene::new(), tempfile::tempdir().unwrap());
    let at = |name: &str| directory.path().join(name);
    let histories = 50_001;
    whole(&scene, histories).write(&at("whole")).unwrap();
    let expected = std::fs::read(at("whole")).unwrap();
    for order in [
        vec!["1/1"],
        vec!["2/2", "1/2"],
        vec!["3/4", "1/4", "4/4", "2/4"],
    ] {
        let paths: Vec<PathBuf> = order
            .iter()
            .map(|part| scene.part(part, histories, directory.path()))
            .collect();
        AnalogTally::merge(&paths)
            .unwrap()
            .write(&at("merged"))
            .unwrap();
        assert!(
            std::fs::read(at("merged")).unwrap() == expected,
            "{order:?}"
        );
    }
    let tally = AnalogTally::read(&at("merged")).unwrap();
    let image = analog(
        &scene.phantom,
        &scene.spectrum,
        &scene.projection,
        &settings(histories, 3),
    );
    assert_eq!(tally.radiograph(), image.unwrap());
    assert_eq!(tally.dose(), whole(&scene, histories).dose());
}

#[test]
fn an_interrupted_run_resumes_from_its_file() {
    let (scene, directory) = (Scene::new(), tempfile::tempdir().unwrap());
    let path = directory.path().join("run");
    let histories = 200_000;
    let run = scene.run(histories, 3);
    let mut tally = run.tally(Part::WHOLE);
    let mut calls = 0;
    let stopped = run.follow(
        &mut tally,
        &Stop::default(),
        |tally, progress: &Progress| {
            assert_eq!(tally.done().end, progress.histories);
            assert!(progress.remaining.is_some() && progress.expected_histories == histories);
            calls += 1;
            if calls == 2 {
                ControlFlow::Break(())
            } else {
                go_on()
            }
        },
    );
    assert_eq!(stopped, Ok(Stopped::Interrupted));
    assert!(tally.done().end < histories);
    tally.write(&path).unwrap();

    let mut tally = scene.run(histories, 3).read(&path, Part::WHOLE).unwrap();
    run.follow(&mut tally, &Stop::default(), |_, _| go_on())
        .unwrap();
    assert_eq!(tally.radiograph(), whole(&scene, histories).radiograph());
    tally.write(&path).unwrap();

    // A complete run can be continued to more histories, but not to fewer.
    let more = scene.run(histories + 999, 3);
    let mut tally = more.read(&path, Part::WHOLE).unwrap();
    more.follow(&mut tally, &Stop::default(), |_, _| go_on())
        .unwrap();
    assert_eq!(tally.dose(), whole(&scene, histories + 999).dose());
    let fewer = scene
        .run(histories - 1, 3)
        .read(&path, Part::WHOLE)
        .unwrap_err();
    assert!(matches!(fewer, TallyError::Histories { .. }), "{fewer}");
}

#[test]
fn overlap_hole_and_foreign_parts_are_refused_by_name() {
    let (scene, directory) = (Scene::new(), tempfile::tempdir().unwrap());
    let part = |part: &str| scene.part(part, 9_000, directory.path());
    let refusal = |paths: &[PathBuf]| AnalogTally::merge(paths).unwrap_err();

    let hole = refusal(&[part("1/3"), part("3/3")]);
    assert!(matches!(&hole, TallyError::Hole { missing, .. } if *missing == (3_000..6_000)));
    assert!(hole.to_string().contains("3000 to 6000"), "{hole}");
    let tail = refusal(&[part("1/3"), part("2/3")]);
    assert!(matches!(&tail, TallyError::Hole { missing, .. } if *missing == (6_000..9_000)));

    let overlap = refusal(&[part("1/2"), part("2/3"), part("3/3")]);
    let text = overlap.to_string();
    assert!(
        text.contains("0 to 4500") && text.contains("3000 to 6000"),
        "{text}"
    );
    assert!(
        text.contains("1of2.tally") && text.contains("2of3.tally"),
        "{text}"
    );
    assert!(matches!(
        refusal(&[part("1/1"), part("1/1")]),
        TallyError::Overlap { .. }
    ));
    assert!(matches!(refusal(&[]), TallyError::Nothing));

    let first = part("1/2");
    let of_another_run = scene.part("2/2", 8_000, directory.path());
    let error = refusal(&[first, of_another_run]);
    assert!(
        matches!(
            error,
            TallyError::Histories {
                found: 8_000,
                expected: 9_000,
                ..
            }
        ),
        "{error}"
    );

    let run = scene.run(9_000, 4);
    let error = run.read(&part("1/2"), "1/2".parse().unwrap()).unwrap_err();
    assert!(
        matches!(error, TallyError::Key { .. }),
        "another seed: {error}"
    );
    let error = scene
        .run(9_000, 3)
        .read(&part("1/2"), "2/2".parse().unwrap())
        .unwrap_err();
    assert!(matches!(error, TallyError::Part { .. }), "{error}");

    let run = scene.run(9_000, 3);
    let path = directory.path().join("unfinished");
    run.tally("1/2".parse().unwrap()).write(&path).unwrap();
    let error = refusal(&[path, part("2/2")]);
    assert!(matches!(error, TallyError::Unfinished { .. }), "{error}");
}

/// Changes that the key of a scene must reflect.
#[test]
fn tallies_of_other_simulations_are_refused() {
    let (scene, directory) = (Scene::new(), tempfile::tempdir().unwrap());
    let path = scene.part("1/1", 1_000, directory.path());
    let refused = |change: &dyn Fn(&mut Scene)| {
        let mut other = Scene::new();
        change(&mut other);
        let read = other.run(1_000, 3).read(&path, Part::WHOLE);
        matches!(read, Err(TallyError::Key { .. }))
    };
    assert!(!refused(&|_| ()));
    assert!(refused(
        &|scene| scene.spectrum = Spectrum::monoenergetic(55.000_001).unwrap()
    ));
    assert!(refused(&|scene| scene.projection.source_detector_mm += 1e-9));
    assert!(refused(&|scene| {
        let mut density = scene.phantom.density_g_cm3().to_vec();
        density[17] += 1e-6;
        let (grid, material) = (
            scene.phantom.grid().clone(),
            scene.phantom.material().to_vec(),
        );
        let materials = scene.phantom.materials().to_vec();
        scene.phantom = VoxelPhantom::new(grid, material, density, materials).unwrap();
    }));
    let settings = settings(1_000, 3);
    let without_dose = AnalogRun::new(
        &scene.phantom,
        &scene.spectrum,
        &scene.projection,
        &settings,
    )
    .unwrap();
    assert!(matches!(
        without_dose.read(&path, Part::WHOLE),
        Err(TallyError::Key { .. })
    ));
}

#[test]
fn files_that_are_no_tallies_are_refused_with_the_reason() {
    let (scene, directory) = (Scene::new(), tempfile::tempdir().unwrap());
    let whole = scene.part("1/1", 1_000, directory.path());
    let bytes = std::fs::read(&whole).unwrap();
    let path = directory.path().join("bad");
    let read = |bytes: &[u8]| {
        std::fs::write(&path, bytes).unwrap();
        AnalogTally::read(&path).unwrap_err()
    };
    for end in [0, 7, 15] {
        assert!(
            matches!(read(&bytes[..end]), TallyError::Foreign { .. }),
            "{end}"
        );
    }
    for end in [16, 40, bytes.len() / 2, bytes.len() - 1] {
        assert!(
            matches!(read(&bytes[..end]), TallyError::Size { .. }),
            "{end}"
        );
    }
    assert!(matches!(
        read(&[&bytes[..], b"x"].concat()),
        TallyError::Size { .. }
    ));
    assert!(matches!(
        read(b"\x89PNG\r\n\x1a\n and so on"),
        TallyError::Foreign { .. }
    ));
    let mut format = bytes.clone();
    format[8] = 77;
    let error = read(&format);
    assert!(
        matches!(error, TallyError::Format { found: 77, .. }),
        "{error}"
    );
    let mut flipped = bytes.clone();
    flipped[bytes.len() - 100] ^= 1;
    assert!(read(&flipped).to_string().contains("checksum"));
    let error = AnalogTally::read(&directory.path().join("nothing")).unwrap_err();
    assert!(matches!(error, TallyError::Read { .. }), "{error}");
    let error = AnalogTally::read(&whole)
        .unwrap()
        .write(directory.path())
        .unwrap_err();
    assert!(matches!(error, TallyError::Write { .. }), "{error}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    /// Every changed byte of the header or the sums is noticed, and none makes the reader panic.
    #[test]
    fn changed_bytes_are_noticed(at in 0.0..1.0_f64, in_header in any::<bool>(), byte in any::<u8>()) {
        static FILE: std::sync::OnceLock<Vec<u8>> = std::sync::OnceLock::new();
        let bytes = FILE.get_or_init(|| {
            let directory = tempfile::tempdir().unwrap();
            std::fs::read(Scene::new().part("1/1", 10, directory.path())).unwrap()
        });
        let reach = if in_header { 600 } else { bytes.len() };
        let at = (at * reach as f64) as usize;
        let mut changed = bytes.clone();
        changed[at] = byte;
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("changed");
        std::fs::write(&path, &changed).unwrap();
        prop_assert_eq!(AnalogTally::read(&path).is_ok(), changed == *bytes);
    }
}

#[test]
fn a_time_limit_is_kept_and_leaves_a_complete_run() {
    let scene = Scene::new();
    let run = scene.run(400_000_000_000, 3);
    let mut tally = run.tally(Part::WHOLE);
    let stop = Stop {
        time: Some(Duration::from_millis(150)),
        ..Stop::default()
    };
    let mut last = None;
    let stopped = run
        .follow(&mut tally, &stop, |_, progress| {
            last = Some(*progress);
            go_on()
        })
        .unwrap();
    assert_eq!(stopped, Stopped::Time);
    assert!(last.unwrap().elapsed < Duration::from_secs(2));
    assert_eq!(tally.done(), tally.part());
    assert_eq!(tally.done(), 0..tally.histories());
}

/// The number of histories at which a run is precise enough depends on the seed alone, and the error is the requested one.
#[test]
fn an_interruption_does_not_change_the_last_history() {
    let scene = Scene::new();
    let run = scene.run(400_000_000_000, 3);
    let stop = Stop {
        relative_error: Some(0.05),
        ..Stop::default()
    };
    let mut straight = run.tally(Part::WHOLE);
    assert_eq!(
        run.follow(&mut straight, &stop, |_, _| go_on()).unwrap(),
        Stopped::Precise
    );
    let error = straight.relative_error();
    // The error falls by at most 5 % from one check to the next.
    assert!((0.045..=0.05).contains(&error), "{error}");

    let image = straight.radiograph();
    let mut errors: Vec<f32> = image
        .sigma()
        .iter()
        .zip(image.total())
        .map(|(sigma, value)| sigma / value)
        .collect();
    errors.sort_by(f32::total_cmp);
    assert!((f64::from(errors[errors.len() / 2]) / error - 1.0).abs() < 0.01);

    let mut interrupted = run.tally(Part::WHOLE);
    loop {
        let ended = run.follow(&mut interrupted, &stop, |_, _| ControlFlow::Break(()));
        if ended.unwrap() == Stopped::Precise {
            break;
        }
    }
    assert_eq!(interrupted.radiograph(), image);
}

#[test]
fn a_tally_of_another_run_is_refused_and_stays() {
    let scene = Scene::new();
    let mut tally = scene.run(3_000, 3).tally(Part::WHOLE);
    let other = scene.run(3_000, 4);
    let refused = other.follow(&mut tally, &Stop::default(), |_, _| go_on());
    assert!(matches!(refused, Err(RunError::OtherTally { .. })));
    assert_eq!(tally.done(), 0..0);
    let own = scene.run(3_000, 3);
    let ended = own.follow(&mut tally, &Stop::default(), |_, _| go_on());
    assert_eq!(ended, Ok(Stopped::Complete));
}

/// The reading of a blurred detector averages several pixels and so is more precise than one of them; electronic noise adds to its error.
#[test]
fn the_error_that_ends_a_run_is_that_of_the_image() {
    let mut scene = Scene::new();
    // Next to the bone.
    scene.projection.detector.pixel_mm = 0.2;
    scene.projection.detector.centre_mm = [27.0, 0.0];
    let error = |scene: &Scene| {
        let settings = settings(200_000, 3);
        let run = AnalogRun::new(
            &scene.phantom,
            &scene.spectrum,
            &scene.projection,
            &settings,
        );
        let run = run.unwrap();
        let mut tally = run.tally(Part::WHOLE);
        run.follow(&mut tally, &Stop::default(), |_, _| go_on())
            .unwrap();
        let image = tally.radiograph();
        let pixels = image.sigma().into_iter().zip(image.total());
        let mut errors: Vec<f32> = pixels.map(|(sigma, total)| sigma / total).collect();
        errors.sort_by(f32::total_cmp);
        assert_eq!(tally.relative_error(), f64::from(errors[errors.len() / 2]));
        tally.relative_error()
    };
    let sharp = error(&scene);
    scene.projection.receptor.blur = Some(Blur::lorentzian(0.45));
    let blurred = error(&scene);
    scene.projection.receptor.electronic_noise_kev = 500.0;
    let noisy = error(&scene);
    assert!(
        blurred < 0.6 * sharp && noisy > 1.5 * blurred,
        "{sharp} {blurred} {noisy}"
    );
}
