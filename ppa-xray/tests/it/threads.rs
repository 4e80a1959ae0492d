//! Exposures computed by several threads at once.

use std::hint::black_box;
use std::sync::mpsc;
use std::thread;
use std::time::Duration;

use nalgebra::Isometry3;
use ppa_phantom::{LowerLeg, TableTop};
use ppa_xray::{
    AnalogSettings, ComptonModel, Detector, FastSettings, HuCalibration, PreparedPhantom,
    Projection, Spectrum, VoxelPhantom, analog,
};
use rayon::prelude::*;

/// Threads of the pool; more than the machine has cores is harmless.
const THREADS: usize = 8;

struct Scene {
    phantom: VoxelPhantom,
    spectrum: Spectrum,
    projection: Projection,
}

fn scene() -> Scene {
    let limb = LowerLeg::p01();
    let joint = limb.truth().joint_centre;
    let volume = limb.voxelise(6.0, TableTop::Absent).unwrap();
    Scene {
        phantom: VoxelPhantom::from_volume(&volume, &HuCalibration::default(), None).unwrap(),
        spectrum: Spectrum::monoenergetic(40.0).unwrap(),
        projection: Projection::new(
            Isometry3::translation(joint.x, joint.y, joint.z - 700.0),
            1100.0,
            Detector::centred(4, 4, 50.0),
        ),
    }
}

/// Runs `round` in a pool of [`THREADS`] and fails if it takes minutes instead of seconds.
fn ends(rounds: usize, round: impl Fn() + Send + Sync + 'static) {
    let (sender, done) = mpsc::channel();
    thread::spawn(move || {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(THREADS);
        let pool = pool.build().unwrap();
        for _ in 0..rounds {
            pool.install(&round);
        }
        sender.send(()).unwrap();
    });
    done.recv_timeout(Duration::from_secs(300))
        .expect("the threads wait for each other");
}

/// Other work whose parts end at different times, so that some threads wait while others start an exposure.
fn uneven_work(item: usize) {
    let steps = item * 7919 % 13 * 200_000;
    let parts = (0..40).into_par_iter().map(|part| {
        (0..steps).fold(part, |hash: usize, step| {
            hash.wrapping_mul(0x5851_f42d).wrapping_add(step)
        })
    });
    black_box(parts.reduce(|| 0, |a, b| a ^ b));
}

/// When the first exposure made the tables in a locked cell, the first or second round deadlocked in two of three runs.
#[test]
fn threads_share_a_prepared_phantom_without_deadlock() {
    let scene = scene();
    ends(2, move || {
        let phantom = PreparedPhantom::new(&scene.phantom, ComptonModel::default());
        let settings = FastSettings::default()
            .with_scatter_histories(100)
            .with_scatter_pixel_mm(200.0)
            .with_samples_per_side(1);
        (0..2 * THREADS).into_par_iter().for_each(|exposure| {
            uneven_work(exposure);
            let image = phantom.fast(&scene.spectrum, &scene.projection, &settings);
            image.unwrap();
        });
    });
}

/// When the first history made the bounds in a locked cell, the 14th and the 26th round deadlocked.
#[test]
fn threads_follow_analog_histories_without_deadlock() {
    let scene = scene();
    ends(60, move || {
        let settings = AnalogSettings::default().with_histories(300_000);
        analog(
            &scene.phantom,
            &scene.spectrum,
            &scene.projection,
            &settings,
        )
        .unwrap();
    });
}
