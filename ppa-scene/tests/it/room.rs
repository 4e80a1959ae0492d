//! The built-in room and recorded rooms.

use nalgebra::{Point3, Vector3};
use ppa_scene::{PlaneSettings, RoomError, RoomSpec, XrayRoom, table_plane};

/// Table top at z = 0, detector 60 mm below, source 1040 mm above, as in the spec.
#[test]
fn built_in_room_has_its_table_under_the_beam() {
    let room = XrayRoom::parametric(&RoomSpec::default()).unwrap();
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

/// Every closed part has outward normals: the divergence theorem gives the parts' volume,
/// once floor and walls (open sheets through known planes) are excluded.
#[test]
fn built_in_room_has_outward_normals_and_no_flat_triangle() {
    let spec = RoomSpec::default();
    let room = XrayRoom::parametric(&spec).unwrap();
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
    let refuse = |spec: RoomSpec, wanted: &str| match XrayRoom::parametric(&spec) {
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
    let furniture_in_furniture = [
        (
            RoomSpec {
                column_distance_mm: 390.0,
                ..spec
            },
            "column_distance_mm",
        ),
        (
            RoomSpec {
                back_wall_mm: 1000.0,
                ..spec
            },
            "back_wall_mm",
        ),
        (
            RoomSpec {
                table_length_mm: 1000.0,
                ..spec
            },
            "table_length_mm",
        ),
        (
            RoomSpec {
                head_wall_mm: 1700.0,
                ..spec
            },
            "head_wall_mm",
        ),
        (
            RoomSpec {
                wall_height_mm: 1900.0,
                ..spec
            },
            "wall_height_mm",
        ),
    ];
    for (spec, wanted) in furniture_in_furniture {
        refuse(spec, wanted);
    }
    let endless = RoomSpec {
        back_wall_mm: 9e4,
        head_wall_mm: 9e4,
        wall_height_mm: 9e4,
        point_spacing_mm: 1.0,
        ..spec
    };
    refuse(endless, "point_spacing_mm");
}

#[test]
fn recorded_rooms_come_from_ply() {
    let folder = tempfile::tempdir().unwrap();
    let built_in = XrayRoom::parametric(&RoomSpec {
        point_spacing_mm: 30.0,
        ..Default::default()
    })
    .unwrap();
    let path = folder.path().join("room.ply");
    ppa_mesh::write_cloud_file(&path, &built_in.cloud).unwrap();
    let recorded = XrayRoom::from_ply(&path, built_in.device).unwrap();
    assert_eq!(recorded.cloud.points, built_in.cloud.points);
    assert!(recorded.mesh.is_none());
    let missing = XrayRoom::from_ply(folder.path().join("no.ply"), built_in.device);
    assert!(matches!(missing, Err(RoomError::Ply(_))));
}
