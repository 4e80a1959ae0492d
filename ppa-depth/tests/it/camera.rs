//! Projection and its inverse.

use nalgebra::{Point2, Point3};
use ppa_depth::{Camera, CameraError, CameraModel, CameraSpec, DepthMode};
use proptest::prelude::*;

/// No distortion, 1000 pixels focal length, principal point (0, 0).
fn plain() -> CameraSpec {
    let mut spec = CameraSpec {
        model: CameraModel::BrownConrady,
        fx: 1e3,
        fy: 1e3,
        cx: 0.0,
        cy: 0.0,
        metric_radius: None,
        ..CameraSpec::azure_kinect(DepthMode::NfovUnbinned)
    };
    for k in [
        &mut spec.k1,
        &mut spec.k2,
        &mut spec.k3,
        &mut spec.k4,
        &mut spec.k5,
        &mut spec.k6,
    ] {
        *k = 0.0;
    }
    (spec.p1, spec.p2) = (0.0, 0.0);
    spec
}

fn camera(spec: CameraSpec) -> Camera {
    Camera::try_from(spec).unwrap()
}

/// The pair that the device SDK's own unit test expects (Azure Kinect Sensor SDK, tests/Transformation/transformation.cpp,
/// tolerance 1e-3 mm and pixels): pixel (256, 256) of the wide mode at 1000 mm.
#[test]
fn the_device_sdk_agrees() {
    let camera = camera(CameraSpec::azure_kinect(DepthMode::WfovBinned));
    let slopes = camera.unproject(&Point2::new(256.0, 256.0)).unwrap();
    assert!(
        (slopes.x * 1e3 + 2.453_761_34).abs() < 1e-5 && (slopes.y * 1e3 + 1.661_076_9).abs() < 1e-5
    );
    let pixel = camera
        .project(&Point3::new(-2.453_761_34, -1.661_076_9, 1000.0))
        .unwrap();
    assert!((pixel - Point2::new(256.0, 256.0)).norm() < 1e-5);
}

/// (0.3, 0.2): s = 0.13, x″ = 0.3 + p2 (s + 0.18) + m p1 0.06, y″ = 0.2 + p1 (s + 0.08) + m p2 0.06.
#[test]
fn the_models_differ_by_the_factor_on_the_mixed_terms() {
    let point = Point3::new(300.0, 200.0, 1000.0);
    for (model, u, v) in [
        (CameraModel::BrownConrady, 307.4, 204.5),
        (CameraModel::Rational6Kt, 306.8, 203.3),
    ] {
        let pixel = camera(CameraSpec {
            model,
            p1: 0.01,
            p2: 0.02,
            ..plain()
        })
        .project(&point)
        .unwrap();
        assert!(
            (pixel - Point2::new(u, v)).norm() < 1e-9,
            "{model:?}: {pixel}"
        );
    }
    // Radial: s = 0.13, d = (1 + 0.1 s + 0.2 s² + 0.3 s³) / (1 + 0.4 s + 0.5 s² + 0.6 s³).
    let radial = CameraSpec {
        k1: 0.1,
        k2: 0.2,
        k3: 0.3,
        k4: 0.4,
        k5: 0.5,
        k6: 0.6,
        ..plain()
    };
    let d = (1.0 + 0.013 + 0.003_38 + 0.000_659_1) / (1.0 + 0.052 + 0.008_45 + 0.001_318_2);
    assert!(
        (camera(radial).project(&point).unwrap() - Point2::new(300.0 * d, 200.0 * d)).norm() < 1e-9
    );
}

proptest! {
    /// Every pixel that has a ray is the projection of that ray; those without are outside the metric radius.
    #[test]
    fn pixels_survive_the_way_there_and_back(u in -0.5..511.5_f64, v in -0.5..511.5_f64, wide: bool, z_mm in 1.0..1e4_f64) {
        let spec = if wide { CameraSpec::azure_kinect(DepthMode::WfovBinned) } else { CameraSpec::azure_kinect(DepthMode::NfovUnbinned) };
        let camera = camera(spec);
        match camera.unproject(&Point2::new(u, v)) {
            Some(slopes) => {
                let pixel = camera.project(&Point3::new(slopes.x * z_mm, slopes.y * z_mm, z_mm)).unwrap();
                prop_assert!((pixel - Point2::new(u, v)).norm() < 1e-7);
            }
            None => {
                prop_assert!(wide);
                // Radius 1.737 falls about 1.05 focal lengths, 265 pixels, from the principal point.
                prop_assert!((Point2::new(u, v) - Point2::new(256.6, 256.4)).norm() > 250.0);
            }
        }
    }

    /// Also for lenses that were never measured, up to where they fold.
    #[test]
    fn directions_survive_for_any_mild_lens(
        k in prop::array::uniform6(-0.2..0.2_f64), p in prop::array::uniform2(-0.005..0.005_f64),
        model in prop::sample::select(vec![CameraModel::BrownConrady, CameraModel::Rational6Kt]),
        x in -0.6..0.6_f64, y in -0.6..0.6_f64,
    ) {
        let [k1, k2, k3, k4, k5, k6] = k;
        let camera = camera(CameraSpec { model, k1, k2, k3, k4, k5, k6, p1: p[0], p2: p[1], ..plain() });
        let Some(pixel) = camera.project(&Point3::new(x, y, 1.0)) else { return Ok(()) };
        let slopes = camera.unproject(&pixel).unwrap();
        prop_assert!((slopes.x - x).abs() < 1e-9 && (slopes.y - y).abs() < 1e-9);
    }
}

/// r (1 − 0.3 r²) grows up to r = 1/√0.9 = 1.0541, where it is 0.70273: beyond, two directions share a pixel.
#[test]
fn a_folding_lens_has_no_pixels_beyond_its_fold() {
    let camera = camera(CameraSpec {
        k1: -0.3,
        ..plain()
    });
    let fold = 0.9_f64.sqrt().recip();
    assert!(
        camera
            .project(&Point3::new(fold * 0.9999, 0.0, 1.0))
            .is_some()
    );
    assert!(
        camera
            .project(&Point3::new(fold * 1.0001, 0.0, 1.0))
            .is_none()
    );
    let edge = 1e3 * fold * 2.0 / 3.0;
    let inside = camera.unproject(&Point2::new(0.0, edge - 0.01)).unwrap();
    assert!(inside.y < fold && inside.x.abs() < 1e-12);
    assert!(camera.unproject(&Point2::new(0.0, edge + 0.01)).is_none());
}

#[test]
fn only_points_in_front_are_seen() {
    let camera = camera(CameraSpec::azure_kinect(DepthMode::NfovUnbinned));
    for z in [0.0, -1000.0, f64::NAN] {
        assert_eq!(camera.project(&Point3::new(0.0, 0.0, z)), None);
    }
    assert_eq!(camera.project(&Point3::new(f64::NAN, 0.0, 1000.0)), None);
    assert_eq!(camera.unproject(&Point2::new(f64::INFINITY, 0.0)), None);
}

#[test]
fn numbers_that_make_no_camera_are_named() {
    let spec = || CameraSpec::azure_kinect(DepthMode::NfovUnbinned);
    let refused = |spec: CameraSpec| Camera::try_from(spec).unwrap_err();
    assert!(matches!(
        refused(CameraSpec { width: 0, ..spec() }),
        CameraError::Size { width: 0, .. }
    ));
    assert!(matches!(
        refused(CameraSpec { fy: -5.0, ..spec() }),
        CameraError::FocalLength { name: "fy", .. }
    ));
    assert!(matches!(
        refused(CameraSpec {
            k3: f64::NAN,
            ..spec()
        }),
        CameraError::NotFinite { name: "k3", .. }
    ));
    assert!(matches!(
        refused(CameraSpec {
            metric_radius: Some(0.0),
            ..spec()
        }),
        CameraError::MetricRadius(_)
    ));
    let bent = CameraSpec {
        model: CameraModel::Pinhole,
        ..spec()
    };
    assert!(matches!(
        refused(bent),
        CameraError::DistortedPinhole { name: "k1", .. }
    ));
}

#[test]
fn a_camera_file_needs_only_what_matters() {
    let text = r#"{"model": "rational_6kt", "name": "left", "width": 64, "height": 48, "fx": 50, "fy": 50, "cx": 32, "cy": 24, "k1": 0.1}"#;
    let spec: CameraSpec = serde_json::from_str(text).unwrap();
    assert_eq!(
        (spec.model, spec.k1, spec.p2, spec.metric_radius),
        (CameraModel::Rational6Kt, 0.1, 0.0, None)
    );
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("camera.json");
    std::fs::write(&path, text.replace("rational_6kt", "fisheye")).unwrap();
    assert!(matches!(
        CameraSpec::read(&path),
        Err(CameraError::Json { .. })
    ));
    assert!(matches!(
        CameraSpec::read(&folder.path().join("none.json")),
        Err(CameraError::Read { .. })
    ));
}

/// Each pose of a limb may be drawn by another thread, with rays not requested before.
#[test]
fn threads_that_draw_at_once_share_the_rays() {
    let threads = rayon::ThreadPoolBuilder::new()
        .num_threads(4)
        .build()
        .unwrap();
    for _ in 0..10 {
        let camera = Camera::try_from(CameraSpec::azure_kinect(DepthMode::WfovBinned)).unwrap();
        let clone = camera.clone();
        let seen = threads.install(|| {
            use rayon::prelude::*;
            (0..64)
                .into_par_iter()
                .map(|_| camera.rays().len())
                .sum::<usize>()
        });
        assert_eq!(seen, 64 * 512 * 512);
        assert!(std::ptr::eq(camera.rays(), clone.rays()));
    }
}
