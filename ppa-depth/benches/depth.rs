//! One limb-like mesh before a recorded room, ideally and through a sensor, at the resolution of the device.
//!
//! Units of work: triangles for meshes, pixels for images and rays. The seed is the formula. Times are processor seconds of all
//! threads, which depend less on other load of the machine than wall-clock time.

mod tube;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use nalgebra::{Isometry3, Point2, Point3, Vector3};
use ppa_benches::ProcessorTime;
use ppa_depth::{
    Backdrop, Body, Camera, CameraSpec, DepthMode, MeshBody, PlacedBody, Sensor, SensorSpec,
    SurfelBody, render,
};

/// Table top above a floor, 5 mm between points: 165 000 discs.
fn room() -> SurfelBody {
    let sheet = |columns: i32, rows: i32, z: f32| {
        let at = move |i: i32, j: i32| {
            Point3::new(
                5.0 * (i - columns / 2) as f32,
                5.0 * (j - rows / 2) as f32,
                z,
            )
        };
        (0..rows).flat_map(move |j| (0..columns).map(move |i| at(i, j)))
    };
    let points: Vec<_> = sheet(140, 320, 60.0)
        .chain(sheet(300, 400, 800.0))
        .collect();
    SurfelBody::new(&points, &vec![Vector3::z(); points.len()], 3.6).expect("a valid cloud")
}

fn placed(body: &Body) -> PlacedBody<'_> {
    PlacedBody {
        body,
        camera_from_body: Isometry3::new(
            Vector3::new(0.0, 0.0, 1000.0),
            Vector3::new(0.0, 0.2, 0.0),
        ),
    }
}

fn depth(c: &mut Criterion<ProcessorTime>) {
    let camera = Camera::try_from(CameraSpec::azure_kinect(DepthMode::NfovUnbinned))
        .expect("the default camera");
    let pixels = u64::from(camera.width() * camera.height());
    let (vertices, triangles) = tube::tube();
    let limb = Body::from(MeshBody::new(&vertices, &triangles).expect("a valid mesh"));
    let room = Body::from(room());

    let mut group = c.benchmark_group("depth");
    group.sample_size(10);
    group.throughput(Throughput::Elements(triangles.len() as u64));
    group.bench_function("mesh_to_distorted_depth", |b| {
        b.iter(|| {
            let body = Body::from(MeshBody::new(&vertices, &triangles).expect("a valid mesh"));
            render(&camera, &[placed(&body)])
        })
    });
    group.bench_function("pose_to_distorted_depth", |b| {
        b.iter(|| render(&camera, &[placed(&limb)]))
    });
    let backdrop = Backdrop::new(&camera, &[placed(&room)]);
    group.bench_function("pose_before_backdrop_with_samples", |b| {
        b.iter(|| backdrop.before(&camera, &[placed(&limb)]))
    });
    group.throughput(Throughput::Elements(pixels));
    let unproject = |index: u64| {
        let (u, v) = (
            index % u64::from(camera.width()),
            index / u64::from(camera.width()),
        );
        camera.unproject(&Point2::new(u as f64, v as f64))
    };
    group.bench_function("unproject_one_thread", |b| {
        b.iter(|| (0..pixels).filter_map(unproject).count())
    });
    let seen = backdrop
        .before(&camera, &[placed(&limb)])
        .expect("the limb is in view");
    let sensor = Sensor::new(SensorSpec::default(), 1).expect("the default sensor");
    group.bench_function("sensor", |b| {
        b.iter(|| sensor.observe(&camera, &seen, 1, 0).unwrap())
    });
    let folder = tempfile::tempdir().expect("a temporary folder");
    let noisy = sensor.observe(&camera, &seen, 1, 0).unwrap();
    group.bench_function("write_png", |b| {
        b.iter(|| noisy.write_png(&folder.path().join("depth.png")))
    });
    // The work for a pose of one body shape in a dataset: both cameras, with noise, as files.
    let other = PlacedBody {
        body: &limb,
        camera_from_body: Isometry3::new(
            Vector3::new(30.0, 0.0, 1100.0),
            Vector3::new(0.0, -0.4, 0.0),
        ),
    };
    group.throughput(Throughput::Elements(2));
    group.bench_function("images_of_two_cameras_with_noise_as_files", |b| {
        b.iter(|| {
            for (stream, seen_from) in [placed(&limb), other].into_iter().enumerate() {
                let seen = backdrop.before(&camera, &[seen_from]).expect("in view");
                let noisy = sensor.observe(&camera, &seen, stream as u64, 0).unwrap();
                noisy
                    .write_png(&folder.path().join("depth.png"))
                    .expect("written");
            }
        })
    });
    group.finish();
}

criterion_group! {
    name = benches;
    config = Criterion::default().with_measurement(ProcessorTime);
    targets = depth
}
criterion_main!(benches);
