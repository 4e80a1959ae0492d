//! Files of meshes and clouds.

use std::fs;
use std::sync::LazyLock;

use nalgebra::{Point3, Vector3};
use ppa_mesh::{
    Border, Mesh, MeshContents, MeshFileError, PointCloud, iso_surface, read_mesh_file,
    write_cloud_file, write_mesh_file,
};
use proptest::prelude::*;
use tempfile::{TempDir, tempdir};

use crate::fields::volume;

const PLY: &str = "ply\nformat ascii 1.0\ncomment a square\nelement vertex 4\nproperty double x\n\
    property double y\nproperty double z\nproperty uchar red\nelement face 1\n\
    property list uchar int vertex_index\nend_header\n0 0 1 9\n1 0 1 9\n1 1 1 9\n0 1 1 9\n4 0 1 2 3\n";
const OBJ: &str = "# a square\nmtllib none.mtl\no square\nv 0 0 1\nv 1 0 1 1.0 0.5 0.5 0.5\nvt 0 0\n\
    v 1 1 1\nv 0 1 1\nvn 0 0 1\ns off\nf 1/1/1 2/1/1 -2/1/1 4/1/1\n";
const STL: &str = "solid square\n facet normal 0 0 1\n  outer loop\n   vertex 0 0 1\n   vertex 1 0 1\n\
    \x20  vertex 1 1 1\n  endloop\n endfacet\nFACET NORMAL 0 0 1\nOUTER LOOP\nVERTEX -0 0 1\nVERTEX 1 1 1\n\
    VERTEX 0 1.0e0 1\nENDLOOP\nENDFACET\nendsolid square\n";

fn ball() -> Mesh {
    let ball = volume([12; 3], [1.0, 1.0, 2.0], |p| {
        (4.0 - (p - Point3::new(5.6, 5.2, 11.1)).norm()) as f32
    });
    iso_surface(&ball, 0.0, Border::Open).unwrap()
}

fn read(
    folder: &TempDir,
    name: &str,
    bytes: impl AsRef<[u8]>,
) -> Result<MeshContents, MeshFileError> {
    let path = folder.path().join(name);
    fs::write(&path, bytes).unwrap();
    read_mesh_file(&path)
}

#[test]
fn what_is_written_is_read_back() {
    let folder = tempdir().unwrap();
    let mesh = ball();
    let cloud = PointCloud {
        points: mesh.vertices.clone(),
        normals: mesh.normals.clone(),
    };
    for name in ["ball.ply", "ball.OBJ"] {
        let path = folder.path().join(name);
        write_mesh_file(&path, &mesh).unwrap();
        assert_eq!(read_mesh_file(&path).unwrap().into_mesh(), mesh, "{name}");
        write_cloud_file(&path, &cloud).unwrap();
        let contents = read_mesh_file(&path).unwrap();
        assert_eq!(contents.cloud, cloud, "{name}");
        assert!(contents.triangles.is_empty());
    }
    // STL has neither normals nor an order of vertices of its own.
    let path = folder.path().join("ball.stl");
    write_mesh_file(&path, &mesh).unwrap();
    let read = read_mesh_file(&path).unwrap().into_mesh();
    let corners = |mesh: &Mesh| -> Vec<[Point3<f32>; 3]> {
        let triangles = mesh.triangles.iter();
        triangles
            .map(|t| t.map(|v| mesh.vertices[v as usize]))
            .collect()
    };
    assert_eq!(corners(&read), corners(&mesh));
    assert_eq!(read.topology(), mesh.topology());
}

#[test]
fn text_of_others_becomes_triangles_with_normals() {
    let folder = tempdir().unwrap();
    for (name, text) in [("a.ply", PLY), ("a.obj", OBJ), ("a.stl", STL)] {
        let mesh = read(&folder, name, text).unwrap().into_mesh();
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]], "{name}");
        assert_eq!(mesh.vertices[2], Point3::new(1.0, 1.0, 1.0), "{name}");
        assert!(mesh.normals.iter().all(|n| *n == Vector3::z()), "{name}");
    }
}

/// Many programs write a name that begins with "solid" into the header of a binary file.
#[test]
fn a_binary_stl_may_call_itself_solid() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("ball.stl");
    write_mesh_file(&path, &ball()).unwrap();
    let mut bytes = fs::read(&path).unwrap();
    bytes[..20].copy_from_slice(b"solid with a name...");
    let read = read(&folder, "ball.stl", &bytes).unwrap();
    assert_eq!(read.triangles.len(), ball().triangles.len());
    let cut = bytes.len() - 1;
    fs::write(&path, &bytes[..cut]).unwrap();
    assert!(matches!(
        read_mesh_file(&path),
        Err(MeshFileError::Format { .. })
    ));
}

#[test]
fn normals_of_no_use_are_left_out_and_others_get_unit_length() {
    let folder = tempdir().unwrap();
    let with = |normal: &str| {
        let text = format!(
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn {normal}\nvn 0 0 2\nvn 0 0 2\nf 1//1 2//2 3//3\n"
        );
        read(&folder, "a.obj", text).unwrap()
    };
    assert_eq!(with("0 3 4").cloud.normals[0], Vector3::new(0.0, 0.6, 0.8));
    for useless in ["0 0 0", "nan 0 1", "inf 0 0"] {
        let contents = with(useless);
        assert!(contents.cloud.normals.is_empty(), "{useless}");
        assert_eq!(contents.into_mesh().normals, [Vector3::z(); 3]);
    }
}

#[test]
fn broken_files_are_refused_with_the_reason() {
    let folder = tempdir().unwrap();
    let reason = |name: &str, text: &str| read(&folder, name, text).unwrap_err().to_string();
    let said = [
        (
            "a.ply",
            "not a mesh".to_owned(),
            "is not a readable PLY file",
        ),
        (
            "a.ply",
            PLY[..PLY.len() - 20].to_owned(),
            "is not a readable PLY file",
        ),
        (
            "a.ply",
            PLY.replace("4 0 1 2 3", "4 0 1 2 9"),
            "refers to vertex 9, but the number of vertices is 4",
        ),
        (
            "a.ply",
            PLY.replace("4 0 1 2 3", "4 0 1 2 -3"),
            "refers to vertex -3",
        ),
        (
            "a.ply",
            PLY.replace("uchar int", "uchar float"),
            "are not whole numbers",
        ),
        (
            "a.ply",
            PLY.replace("double z", "double w"),
            "no vertices with x, y and z",
        ),
        ("a.ply", PLY.replace("1 1 1 9", "1 nan 1 9"), "Line 14:"),
        ("a.obj", "not a mesh".to_owned(), "no vertices"),
        (
            "a.obj",
            OBJ.replace("-2/1/1", "5/1/1"),
            "refers to vertex 5, but the number of vertices is 4",
        ),
        ("a.obj", OBJ.replace("-2/1/1", "0"), "refers to vertex 0"),
        (
            "a.obj",
            OBJ.replace("-2/1/1", "x"),
            "line 11: \"x\" is not a face vertex",
        ),
        (
            "a.obj",
            OBJ.replace("v 0 1 1", "v 0 one 1"),
            "line 8: expected three numbers",
        ),
        ("a.obj", OBJ.replace("v 0 1 1", "v 0 inf 1"), "vertex 3 of"),
        (
            "a.stl",
            "not a mesh".to_owned(),
            "is not a readable STL file",
        ),
        (
            "a.stl",
            STL.replace("vertex 1 0 1\n", ""),
            "expected three corners",
        ),
        (
            "a.stl",
            STL.replace("vertex 1 0 1", "vertex 1 0"),
            "line 5: expected three",
        ),
        (
            "a.stl",
            STL.replace("endsolid square\n", ""),
            "without \"endsolid\"",
        ),
        (
            "a.stl",
            STL.replace("vertex 1 0 1", "vertex 1 nan 1"),
            "vertex 1 of",
        ),
    ];
    for (name, text, expected) in said {
        let found = reason(name, &text);
        assert!(found.contains(expected), "{found}, expected {expected}");
    }
    let path = folder.path();
    let mut cloud = PointCloud::default();
    cloud.points.push(Point3::new(0.0, f32::NAN, 0.0));
    write_cloud_file(&path.join("nan.ply"), &cloud).unwrap();
    let unknown = read_mesh_file(&path.join("nan.ply"));
    assert!(matches!(
        unknown,
        Err(MeshFileError::NotFinite { vertex: 0, .. })
    ));
    let missing = read_mesh_file(&path.join("missing.ply"));
    assert!(matches!(missing, Err(MeshFileError::Open { .. })));
    let nowhere = write_mesh_file(&path.join("no/such/folder.ply"), &Mesh::default());
    assert!(matches!(nowhere, Err(MeshFileError::Write { .. })));
    let cloud = write_cloud_file(&path.join("cloud.stl"), &PointCloud::default());
    assert!(matches!(cloud, Err(MeshFileError::NoCloud { .. })));
    let unknown = write_mesh_file(&path.join("mesh.gltf"), &Mesh::default());
    assert!(matches!(unknown, Err(MeshFileError::Extension { .. })));
}

/// Small valid files of every kind.
static SEEDS: LazyLock<Vec<(&str, Vec<u8>)>> = LazyLock::new(|| {
    let folder = tempdir().unwrap();
    let mut seeds = Vec::from([
        ("a.ply", PLY.into()),
        ("a.obj", OBJ.into()),
        ("a.stl", STL.into()),
    ]);
    for name in ["a.ply", "a.obj", "a.stl"] {
        let path = folder.path().join(name);
        write_mesh_file(&path, &ball()).unwrap();
        seeds.push((name, fs::read(path).unwrap()));
    }
    seeds
});

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]
    /// However a file is damaged, reading ends with an error or with a consistent mesh.
    #[test]
    fn damaged_files_do_no_harm(
        seed in any::<prop::sample::Index>(),
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..6),
        cut in prop::option::of(any::<prop::sample::Index>()),
        doubled in prop::option::of(any::<prop::sample::Index>()),
    ) {
        let (name, bytes) = &SEEDS[seed.index(SEEDS.len())];
        let mut bytes = bytes.clone();
        for (at, byte) in changes {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        if let Some(at) = doubled {
            let tail = bytes[at.index(bytes.len())..].to_vec();
            bytes.extend(tail);
        }
        if let Some(at) = cut {
            bytes.truncate(at.index(bytes.len()));
        }
        let folder = tempdir().unwrap();
        if let Ok(contents) = read(&folder, name, bytes) {
            let mesh = contents.into_mesh();
            let count = mesh.vertices.len();
            prop_assert!(mesh.triangles.iter().flatten().all(|&v| (v as usize) < count));
            prop_assert!(mesh.vertices.iter().all(|p| p.coords.iter().all(|c| c.is_finite())));
            prop_assert_eq!(mesh.normals.len(), count);
        }
    }
}
