//! PLY files.

use std::fs;

use nalgebra::{Point3, Vector3};
use ppa_mesh::{Border, PlyError, PointCloud, iso_surface, read_ply, write_ply, write_ply_cloud};

use crate::fields::volume;

const SQUARE: &str = "ply\nformat ascii 1.0\ncomment a square\nelement vertex 4\nproperty double x\n\
    property double y\nproperty double z\nproperty uchar red\nelement face 1\n\
    property list uchar int vertex_index\nend_header\n0 0 1 9\n1 0 1 9\n1 1 1 9\n0 1 1 9\n4 0 1 2 3\n";

#[test]
fn what_is_written_is_read_back() {
    let folder = tempfile::tempdir().unwrap();
    let ball = volume([12; 3], [1.0, 1.0, 2.0], |p| {
        (4.0 - (p - Point3::new(5.6, 5.2, 11.1)).norm()) as f32
    });
    let mesh = iso_surface(&ball, 0.0, Border::Open).unwrap();
    let path = folder.path().join("ball.ply");
    write_ply(&path, &mesh).unwrap();
    assert_eq!(read_ply(&path).unwrap().into_mesh(), mesh);
    write_ply_cloud(&path, &mesh.to_cloud()).unwrap();
    let contents = read_ply(&path).unwrap();
    assert_eq!(contents.cloud, mesh.to_cloud());
    assert!(contents.triangles.is_empty());
}

#[test]
fn foreign_ascii_polygons_become_triangles_with_normals() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("square.ply");
    fs::write(&path, SQUARE).unwrap();
    let mesh = read_ply(&path).unwrap().into_mesh();
    assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
    assert!(mesh.normals.iter().all(|n| *n == Vector3::z()));
}

#[test]
fn broken_files_are_refused_with_the_reason() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("broken.ply");
    let with = |text: &str| {
        fs::write(&path, text).unwrap();
        read_ply(&path).unwrap_err()
    };
    assert!(matches!(with("not a mesh"), PlyError::Format { .. }));
    assert!(matches!(
        with(&SQUARE[..SQUARE.len() - 20]),
        PlyError::Format { .. }
    ));
    assert!(matches!(
        with(&SQUARE.replace("4 0 1 2 3", "4 0 1 2 9")),
        PlyError::Index { face: 0, .. }
    ));
    assert!(matches!(
        with(&SQUARE.replace("4 0 1 2 3", "4 0 1 2 -3")),
        PlyError::Index { .. }
    ));
    assert!(matches!(
        with(&SQUARE.replace("double z", "double w")),
        PlyError::NoVertices { .. }
    ));
    let mut cloud = PointCloud::default();
    cloud.points.push(Point3::new(0.0, f32::NAN, 0.0));
    write_ply_cloud(&path, &cloud).unwrap();
    let unknown = read_ply(&path).unwrap_err();
    assert!(matches!(unknown, PlyError::NotFinite { vertex: 0, .. }));
    let missing = read_ply(&folder.path().join("missing.ply")).unwrap_err();
    assert!(matches!(missing, PlyError::Open { .. }));
    let nowhere = write_ply(
        &folder.path().join("no/such/folder.ply"),
        &Default::default(),
    );
    assert!(matches!(nowhere, Err(PlyError::Write { .. })));
}
