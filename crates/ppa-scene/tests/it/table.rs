use nalgebra::{Point3, Vector3};
use ppa_mesh::PointCloud;
use ppa_scene::{PlaneError, PlaneSettings, Room, RoomError, RoomSpec, TablePlane, table_plane};

/// SplitMix64 of (index + seed · 2³²), sum of two uniforms: in [-1, 1), triangular.
fn hash_noise(index: u64, seed: u64) -> f64 {
    let mut z = (index + (seed << 32) + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    z = (z ^ z >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ z >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^= z >> 31;
    (z & 0xFFFF_FFFF) as f64 / 4_294_967_296.0 + (z >> 32) as f64 / 4_294_967_296.0 - 1.0
}

/// A noisy room in mm: table of 2.0 x 0.6 m at 900 mm, floor at 0, wall at y = 1.5 m, clutter;
/// noise of 3 mm standard deviation. `keep` picks heights before rounding to f32.
fn room_cloud(n: u64, seed: u64, keep: std::ops::Range<f64>) -> PointCloud {
    let uniform = |i: u64, which: u64| (hash_noise(i, seed + 10 * which) + 1.0) / 2.0;
    let noise = |i: u64, which: u64| hash_noise(i, seed + 10 * which + 5) * 2.45 * 3.0;
    let points = (0..n)
        .map(|i| {
            let (u, v, w) = (uniform(i, 0), uniform(i, 1), uniform(i, 2));
            let (x, y) = (u * 4000.0 - 2000.0, v * 3000.0 - 1500.0);
            let p = match i % 100 {
                0..30 => Point3::new(u * 2000.0 - 1000.0, v * 600.0 - 300.0, 900.0),
                30..65 => Point3::new(x, y, 0.0),
                65..85 => Point3::new(x, 1500.0, v * 2500.0),
                _ => Point3::new(x, y, w * 2500.0),
            };
            p + Vector3::new(noise(i, 0), noise(i, 1), noise(i, 2))
        })
        .filter(|p| keep.contains(&p.z))
        .map(|p| p.cast())
        .collect();
    PointCloud {
        points,
        normals: Vec::new(),
    }
}

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

/// Table top at z = 0, detector 60 mm below, source 1040 mm above: what the spec says.
#[test]
fn built_in_room_has_its_table_under_the_beam() {
    let room = Room::parametric(&RoomSpec::default()).unwrap();
    let settings = PlaneSettings::for_device(&room.device);
    let found = table_plane(&room.cloud, &settings, 1).unwrap();
    assert!(
        found.plane.normal.z > 0.999_999 && found.plane.offset_mm.abs() < 0.01,
        "{found:?}"
    );
    assert!(
        (found.centre.coords - Vector3::new(0.0, 650.0, 0.0)).norm() < 5.0,
        "{found:?}"
    );
    let detector = room.device.room_from_device * Point3::new(0.0, 0.0, 1100.0);
    assert!((detector - Point3::new(0.0, 0.0, -60.0)).norm() < 1e-9);
}

/// Every closed part has its outside outside: the divergence theorem gives the parts' volume,
/// once floor and walls (open sheets through known planes) are taken off.
#[test]
fn built_in_room_has_outward_normals_and_no_flat_triangle() {
    let spec = RoomSpec::default();
    let room = Room::parametric(&spec).unwrap();
    let mesh = room.mesh.unwrap();
    let sheets = 3 * 2; // floor and two walls, last in the list
    let closed = &mesh.triangles[..mesh.triangles.len() - sheets];
    let mut volume = 0.0;
    for (index, triangle) in mesh.triangles.iter().enumerate() {
        let [a, b, c] = triangle.map(|v| mesh.vertices[v as usize].cast::<f64>());
        let normal = (b - a).cross(&(c - a));
        assert!(normal.norm() > 1.0, "triangle {index} is flat");
        for v in triangle {
            let at_vertex = mesh.normals[*v as usize].cast::<f64>();
            assert!(
                at_vertex.dot(&normal.normalize()) > 0.99,
                "triangle {index}"
            );
        }
        if index < closed.len() {
            volume += a.coords.dot(&b.coords.cross(&c.coords)) / 6.0;
        }
    }
    let table = 2200.0 * 800.0 * 30.0;
    let detector = 430.0 * 430.0 * 20.0;
    let pedestal = 400.0 * 500.0 * 770.0;
    let collimator = 180.0 * 180.0 * 80.0;
    let arm = 810.0 * 120.0 * 90.0;
    let column = 200.0 * 240.0 * 2700.0;
    // A regular 72-gon instead of a circle.
    let housing = 36.0 * (std::f64::consts::TAU / 72.0).sin() * 90.0_f64.powi(2) * 460.0;
    let expected = table + detector + pedestal + collimator + arm + column + housing;
    assert!(
        (volume / expected - 1.0).abs() < 1e-5,
        "{volume} instead of {expected} mm³"
    );
}

#[test]
fn impossible_rooms_are_refused() {
    let refuse = |spec: RoomSpec, wanted: &str| match Room::parametric(&spec) {
        Err(RoomError::Length { name, .. }) => assert_eq!(name, wanted),
        other => panic!("{wanted}: {other:?}"),
    };
    let spec = RoomSpec::default();
    refuse(
        RoomSpec {
            table_width_mm: -1.0,
            ..spec
        },
        "table_width_mm",
    );
    refuse(
        RoomSpec {
            point_spacing_mm: 0.0,
            ..spec
        },
        "point_spacing_mm",
    );
    refuse(
        RoomSpec {
            table_detector_mm: 10.0,
            ..spec
        },
        "table_detector_mm",
    );
    refuse(
        RoomSpec {
            source_detector_mm: f64::NAN,
            ..spec
        },
        "source_detector_mm",
    );
}

#[test]
fn recorded_rooms_come_from_ply() {
    let folder = tempfile::tempdir().unwrap();
    let built_in = Room::parametric(&RoomSpec {
        point_spacing_mm: 30.0,
        ..Default::default()
    })
    .unwrap();
    let path = folder.path().join("room.ply");
    ppa_mesh::write_cloud_file(&path, &built_in.cloud).unwrap();
    let recorded = Room::from_ply(&path, built_in.device).unwrap();
    assert_eq!(recorded.cloud.points, built_in.cloud.points);
    assert!(recorded.mesh.is_none());
    let missing = Room::from_ply(folder.path().join("no.ply"), built_in.device);
    assert!(matches!(missing, Err(RoomError::Ply(_))));
}
