//! The table plane in point clouds.

use nalgebra::Point3;
use ppa_mesh::PointCloud;
use ppa_scene::{PlaneError, PlaneSettings, TablePlane, table_plane};
use ppa_tests::hash_noise;

use crate::recorded_room::room_cloud;

fn check(found: &TablePlane, height_mm: f64, centre: Point3<f64>) {
    let angle = found.plane.normal.z.acos().to_degrees();
    assert!(angle <= 0.05, "{angle} degrees from level");
    let offset = found
        .plane
        .signed_distance(&Point3::new(centre.x, centre.y, height_mm));
    assert!(offset.abs() <= 1.0, "{offset} mm off at the table's centre");
}

/// The wall through the table's plane must not tilt it: least squares over all inliers would be
/// off by 0.32 degrees. 18 000 points with 3 mm noise on 0.6 m give 0.01 degrees.
#[test]
fn wall_through_the_plane_does_not_tilt_it() {
    let cloud = room_cloud(60_000, 11, 300.0..1400.0);
    assert_eq!(cloud.points.len(), 30_322);
    for seed in 0..5 {
        let found = table_plane(&cloud, &PlaneSettings::default(), seed).unwrap();
        check(&found, 900.0, Point3::origin());
        assert!(
            (17_500..18_500).contains(&found.inliers),
            "{} inliers",
            found.inliers
        );
        assert!((found.rms_mm - 3.0).abs() < 0.1, "rms {} mm", found.rms_mm);
    }
}

/// Ten thousand separate tiles, each a patch of its own: searching all points for each
/// would take minutes.
#[test]
fn many_small_patches_are_no_trouble() {
    let tile = |n: u16| Point3::new(f32::from(n % 100), f32::from(n / 100), 0.0) * 200.0;
    let corners = [[0.0, 0.0], [9.0, 1.0], [2.0, 8.0], [6.0, 3.0], [4.0, 9.0]];
    let points =
        (0..10_000).flat_map(|n| corners.map(|[x, y]| tile(n) + nalgebra::Vector3::new(x, y, 0.0)));
    let cloud = PointCloud {
        points: points.collect(),
        normals: Vec::new(),
    };
    let settings = PlaneSettings {
        min_area_mm2: 1.0,
        iterations: 50,
        ..PlaneSettings::default()
    };
    let found = table_plane(&cloud, &settings, 1).unwrap();
    assert!(found.plane.offset_mm.abs() < 1e-6, "{found:?}");
    assert!((3..=5).contains(&found.inliers), "{found:?}");
}

#[test]
fn the_floor_is_found_when_there_is_nothing_else() {
    let cloud = room_cloud(60_000, 31, -200.0..500.0);
    let found = table_plane(&cloud, &PlaneSettings::default(), 1).unwrap();
    check(&found, 0.0, Point3::origin());
}

/// The floor is larger, but the beam meets the table first; clutter and walls are there too.
#[test]
fn the_beam_tells_the_table_from_the_floor() {
    let cloud = room_cloud(60_000, 11, -1e9..1e9);
    let largest = table_plane(&cloud, &PlaneSettings::default(), 1).unwrap();
    check(&largest, 0.0, Point3::origin());
    let settings = PlaneSettings {
        beam: Some([[200.0, 50.0, 2000.0], [0.0, 0.05, -1.0]]),
        ..PlaneSettings::default()
    };
    let found = table_plane(&cloud, &settings, 1).unwrap();
    check(&found, 900.0, Point3::origin());
    let region = PlaneSettings {
        region: Some([[-2000.0, -1000.0, 300.0], [2000.0, 1000.0, 1400.0]]),
        ..PlaneSettings::default()
    };
    check(
        &table_plane(&cloud, &region, 1).unwrap(),
        900.0,
        Point3::origin(),
    );
}

#[test]
fn threads_and_repeats_do_not_change_the_plane() {
    let cloud = room_cloud(20_000, 3, 300.0..1400.0);
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| table_plane(&cloud, &PlaneSettings::default(), 7).unwrap())
    };
    assert_eq!(on(1), on(3));
}

#[test]
fn clouds_without_a_plane_are_refused() {
    let settings = PlaneSettings::default();
    let clutter = PointCloud {
        points: (0..20_000)
            .map(|i| Point3::new(0, 1, 2).map(|axis: u64| 1000.0 * hash_noise(i, axis) as f32))
            .collect(),
        normals: Vec::new(),
    };
    for seed in 0..5 {
        let error = table_plane(&clutter, &settings, seed).unwrap_err();
        assert!(matches!(error, PlaneError::NoPlane { .. }), "{error}");
    }
    let wall = PointCloud {
        points: (0..10_000)
            .map(|i| Point3::new(5.0, (i % 100) as f32 * 20.0, (i / 100) as f32 * 20.0))
            .collect(),
        normals: Vec::new(),
    };
    let error = table_plane(&wall, &settings, 1).unwrap_err();
    assert!(matches!(error, PlaneError::NoPlane { .. }), "{error}");
    let upright = PlaneSettings {
        up: [1.0, 0.0, 0.0],
        ..settings.clone()
    };
    assert!((table_plane(&wall, &upright, 1).unwrap().plane.offset_mm - 5.0).abs() < 1e-9);
    let line = PointCloud {
        points: (0..1000)
            .map(|i| Point3::new(1.0, 2.0, 0.3) * i as f32)
            .collect(),
        normals: Vec::new(),
    };
    let error = table_plane(&line, &settings, 1).unwrap_err();
    assert_eq!(error, PlaneError::OneLine { found: 1000 });
    let error = table_plane(&PointCloud::default(), &settings, 1).unwrap_err();
    assert!(matches!(error, PlaneError::TooFewPoints { found: 0, .. }));
    let backwards = PlaneSettings {
        region: Some([[0.0, 0.0, 9.0], [1.0, 1.0, 3.0]]),
        ..settings.clone()
    };
    let error = table_plane(&wall, &backwards, 1).unwrap_err();
    assert!(
        matches!(error, PlaneError::Setting { name: "region", .. }),
        "{error}"
    );
    let bad = PlaneSettings {
        threshold_mm: f64::NAN,
        ..settings
    };
    let error = table_plane(&wall, &bad, 1).unwrap_err();
    assert!(matches!(
        error,
        PlaneError::Setting {
            name: "threshold_mm",
            ..
        }
    ));
}
