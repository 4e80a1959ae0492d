//! Meshes and clouds in files: PLY, OBJ or STL, by the extension of the name.

mod error;
mod obj;
mod ply;
mod polygons;
mod stl;

use std::io::{self, BufReader, Write};
use std::path::Path;

use nalgebra::{Point3, Vector3};
use ppa_core::{regular_file, whole_file};

use crate::mesh::{Mesh, PointCloud};
use error::Fault;
pub use error::MeshFileError;

/// Contents of a mesh file.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct MeshContents {
    /// All vertices; normals are empty if the file has no usable ones.
    pub cloud: PointCloud,
    /// Triangles of the faces, with polygons cut into fans; empty for a cloud.
    pub triangles: Vec<[u32; 3]>,
}

impl MeshContents {
    /// The contents as a mesh; missing normals are computed from the triangles.
    pub fn into_mesh(self) -> Mesh {
        let mut mesh = Mesh {
            vertices: self.cloud.points,
            normals: self.cloud.normals,
            triangles: self.triangles,
        };
        if mesh.normals.len() != mesh.vertices.len() {
            mesh.normals = mesh.geometric_normals();
        }
        mesh
    }
}

#[derive(Debug, Clone, Copy)]
enum Format {
    Ply,
    Obj,
    Stl,
}

impl Format {
    fn of(path: &Path) -> Result<Self, MeshFileError> {
        let extension = path.extension().unwrap_or_default().to_string_lossy();
        match extension.to_ascii_lowercase().as_str() {
            "ply" => Ok(Self::Ply),
            "obj" => Ok(Self::Obj),
            "stl" => Ok(Self::Stl),
            _ => Err(MeshFileError::Extension {
                path: path.to_owned(),
            }),
        }
    }
}

/// Reads a mesh or a cloud in mm: PLY or STL, text or binary, or OBJ.
///
/// Colours, textures and groups are skipped. Normals are kept if the file has one per vertex and all of
/// them have a direction; vertices of an STL file at the same position are merged.
///
/// # Errors
/// [`MeshFileError`] when the file is missing, broken, or has no points.
pub fn read_mesh_file(path: &Path) -> Result<MeshContents, MeshFileError> {
    let format = Format::of(path)?;
    let open = |source| MeshFileError::Open {
        path: path.to_owned(),
        source,
    };
    let contents = match format {
        Format::Ply => ply::read(BufReader::new(regular_file::open(path).map_err(open)?)),
        Format::Obj => obj::read(&regular_file::read(path).map_err(open)?),
        Format::Stl => stl::read(&regular_file::read(path).map_err(open)?),
    };
    let checked = contents.and_then(|mut contents| {
        let points = &contents.cloud.points;
        let finite = |p: &Point3<f32>| p.coords.iter().all(|c| c.is_finite());
        if points.is_empty() {
            return Err(Fault::NoVertices);
        }
        if let Some(vertex) = points.iter().position(|p| !finite(p)) {
            return Err(Fault::NotFinite(vertex));
        }
        contents.cloud.normals = directions(contents.cloud.normals);
        Ok(contents)
    });
    checked.map_err(|fault| MeshFileError::in_file(path, fault))
}

/// Unit vectors, or an empty list if one of them has no direction.
fn directions(mut normals: Vec<Vector3<f32>>) -> Vec<Vector3<f32>> {
    for normal in &mut normals {
        let length = normal.norm();
        if !(length.is_finite() && length > 0.0) {
            return Vec::new();
        }
        // Rounding errors are kept, so that writing and reading changes nothing.
        if (length - 1.0).abs() > 1e-4 {
            *normal /= length;
        }
    }
    normals
}

/// Writes a mesh atomically: binary little-endian PLY or OBJ with normals, or binary STL.
///
/// # Errors
/// [`MeshFileError::Extension`] and [`MeshFileError::Write`].
pub fn write_mesh_file(path: &Path, mesh: &Mesh) -> Result<(), MeshFileError> {
    let (points, normals) = (&mesh.vertices, &mesh.normals);
    match Format::of(path)? {
        Format::Ply => store(path, |out| {
            ply::write(out, points, normals, Some(&mesh.triangles))
        }),
        Format::Obj => store(path, |out| {
            obj::write(out, points, normals, &mesh.triangles)
        }),
        Format::Stl => store(path, |out| stl::write(out, mesh)),
    }
}

/// Writes a cloud atomically, with normals if it has one per point: PLY or OBJ.
///
/// # Errors
/// [`MeshFileError::Extension`], [`MeshFileError::NoCloud`] and [`MeshFileError::Write`].
pub fn write_cloud_file(path: &Path, cloud: &PointCloud) -> Result<(), MeshFileError> {
    let (points, normals) = (&cloud.points, &cloud.normals);
    match Format::of(path)? {
        Format::Ply => store(path, |out| ply::write(out, points, normals, None)),
        Format::Obj => store(path, |out| obj::write(out, points, normals, &[])),
        Format::Stl => Err(MeshFileError::NoCloud {
            path: path.to_owned(),
        }),
    }
}

fn store(
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<(), MeshFileError> {
    whole_file::write_with(path, |out| write(out)).map_err(|source| MeshFileError::Write {
        path: path.to_owned(),
        source,
    })
}
