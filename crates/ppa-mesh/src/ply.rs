//! PLY files: meshes and clouds out, ascii and both binary orders in.

use std::fs::File;
use std::io::{self, BufReader, BufWriter};
use std::path::{Path, PathBuf};

use atomic_write_file::AtomicWriteFile;
use nalgebra::{Point3, Vector3};
use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{
    Addable, DefaultElement, ElementDef, Encoding, Header, Property, PropertyAccess,
    PropertyAccessResult, PropertyDef, PropertyType, ScalarType,
};
use ply_rs_bw::writer::Writer;

use crate::mesh::{Mesh, PointCloud};

/// Why a PLY file could not be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PlyError {
    /// The file cannot be opened.
    #[error("cannot open {}", path.display())]
    Open {
        /// File asked for.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// Not a PLY file, or cut short.
    #[error("{} is not a readable PLY file: {reason}", path.display())]
    Format {
        /// File asked for.
        path: PathBuf,
        /// What the parser found.
        reason: String,
    },
    /// No vertex element with x, y and z.
    #[error("{} has no vertex element with the properties x, y and z", path.display())]
    NoVertices {
        /// File asked for.
        path: PathBuf,
    },
    /// A coordinate is NaN or infinite.
    #[error("vertex {vertex} of {} has a coordinate that is not a number", path.display())]
    NotFinite {
        /// File asked for.
        path: PathBuf,
        /// Index of the vertex.
        vertex: usize,
    },
    /// A face names a vertex that does not exist.
    #[error("face {face} of {} names a vertex beyond the {vertices} there are", path.display())]
    Index {
        /// File asked for.
        path: PathBuf,
        /// Index of the face.
        face: usize,
        /// Number of vertices.
        vertices: usize,
    },
    /// The file cannot be written.
    #[error("cannot write {}", path.display())]
    Write {
        /// File asked for.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
}

/// What a PLY file holds.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PlyContents {
    /// All vertices; normals are empty when the file has none.
    pub cloud: PointCloud,
    /// Faces, polygons cut into fans; empty for a cloud.
    pub triangles: Vec<[u32; 3]>,
}

impl PlyContents {
    /// The contents as a mesh; missing normals are made from the triangles.
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

const POSITION: [&str; 3] = ["x", "y", "z"];
const NORMAL: [&str; 3] = ["nx", "ny", "nz"];

#[derive(Default)]
struct Vertex {
    position: [f32; 3],
    normal: [f32; 3],
}

impl PropertyAccess for Vertex {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, name: &str, value: Property) -> PropertyAccessResult {
        let Some(value) = value.to_f32_lossy() else {
            return PropertyAccessResult::Ignored;
        };
        for (names, target) in [(POSITION, &mut self.position), (NORMAL, &mut self.normal)] {
            if let Some(axis) = names.iter().position(|n| *n == name) {
                target[axis] = value;
                return PropertyAccessResult::Set;
            }
        }
        PropertyAccessResult::Ignored
    }

    fn get_float(&self, name: &str) -> Option<f32> {
        let found = |names: [&str; 3]| names.iter().position(|n| *n == name);
        let position = found(POSITION).map(|axis| self.position[axis]);
        position.or_else(|| found(NORMAL).map(|axis| self.normal[axis]))
    }
}

#[derive(Default)]
struct Face {
    vertices: Vec<u32>,
    negative: bool,
}

impl PropertyAccess for Face {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, name: &str, value: Property) -> PropertyAccessResult {
        // Both names are in use; the plural is the older one.
        if !matches!(name, "vertex_indices" | "vertex_index") {
            return PropertyAccessResult::Ignored;
        }
        match value.to_u32_list() {
            Some(vertices) => self.vertices = vertices,
            None => self.negative = true,
        }
        PropertyAccessResult::Set
    }

    fn get_list_uint(&self, name: &str) -> Option<&[u32]> {
        (name == "vertex_indices").then_some(&self.vertices)
    }
}

/// Writes a mesh with normals, binary little endian, whole or not at all.
///
/// # Errors
/// [`PlyError::Write`].
pub fn write_ply(path: &Path, mesh: &Mesh) -> Result<(), PlyError> {
    write(path, &mesh.vertices, &mesh.normals, Some(&mesh.triangles))
}

/// Writes a cloud, with normals if it has one per point, binary little endian, whole or not at all.
///
/// # Errors
/// [`PlyError::Write`].
pub fn write_ply_cloud(path: &Path, cloud: &PointCloud) -> Result<(), PlyError> {
    write(path, &cloud.points, &cloud.normals, None)
}

fn write(
    path: &Path,
    points: &[Point3<f32>],
    normals: &[Vector3<f32>],
    triangles: Option<&[[u32; 3]]>,
) -> Result<(), PlyError> {
    let with_normals = normals.len() == points.len();
    let vertices: Vec<Vertex> = points
        .iter()
        .enumerate()
        .map(|(at, point)| Vertex {
            position: point.coords.into(),
            normal: if with_normals {
                normals[at].into()
            } else {
                [0.0; 3]
            },
        })
        .collect();
    let faces: Vec<Face> = triangles
        .unwrap_or_default()
        .iter()
        .map(|triangle| Face {
            vertices: triangle.to_vec(),
            negative: false,
        })
        .collect();

    let mut header = Header::new();
    header.encoding = Encoding::BinaryLittleEndian;
    let mut vertex = ElementDef::new("vertex".to_owned());
    vertex.count = vertices.len();
    let names = POSITION
        .iter()
        .chain(NORMAL.iter().filter(|_| with_normals));
    for name in names {
        let kind = PropertyType::Scalar(ScalarType::Float);
        vertex
            .properties
            .add(PropertyDef::new((*name).to_owned(), kind));
    }
    let mut face = ElementDef::new("face".to_owned());
    face.count = faces.len();
    face.properties.add(PropertyDef::new(
        "vertex_indices".to_owned(),
        PropertyType::List(ScalarType::UChar, ScalarType::UInt),
    ));
    header.elements.add(vertex.clone());
    if triangles.is_some() {
        header.elements.add(face.clone());
    }

    let store = || -> io::Result<()> {
        if path.is_dir() {
            return Err(io::ErrorKind::IsADirectory.into());
        }
        let mut out = BufWriter::new(AtomicWriteFile::open(path)?);
        let vertex_writer = Writer::<Vertex>::new();
        vertex_writer.write_header(&mut out, &header)?;
        vertex_writer.write_payload_of_element(&mut out, &vertices, &vertex, &header)?;
        if triangles.is_some() {
            Writer::<Face>::new().write_payload_of_element(&mut out, &faces, &face, &header)?;
        }
        out.into_inner().map_err(|e| e.into_error())?.commit()
    };
    store().map_err(|source| PlyError::Write {
        path: path.to_owned(),
        source,
    })
}

/// Reads a mesh or a cloud; ascii, binary little endian or binary big endian.
///
/// Further elements and properties (colours, quality) are skipped.
///
/// # Errors
/// [`PlyError`] when the file is missing, broken, or not about points.
pub fn read_ply(path: &Path) -> Result<PlyContents, PlyError> {
    let file = File::open(path).map_err(|source| PlyError::Open {
        path: path.to_owned(),
        source,
    })?;
    // The parser appends its state on further lines.
    let broken = |reason: String| PlyError::Format {
        path: path.to_owned(),
        reason: reason.lines().next().unwrap_or_default().to_owned(),
    };
    let mut reader = Reader::new(BufReader::new(file));
    let header = Parser::<Vertex>::new()
        .read_header(&mut reader)
        .map_err(|e| broken(e.to_string()))?;
    let mut contents = None;
    let mut faces = Vec::new();
    for element in header.elements.values() {
        let has = |names: [&str; 3]| names.iter().all(|n| element.properties.contains_key(*n));
        if element.name == "vertex" && has(POSITION) {
            let vertices = Parser::<Vertex>::new()
                .read_payload_for_element(&mut reader, element, &header)
                .map_err(|e| broken(e.to_string()))?;
            contents = Some((vertices, has(NORMAL)));
        } else if element.name == "face" {
            faces = Parser::<Face>::new()
                .read_payload_for_element(&mut reader, element, &header)
                .map_err(|e| broken(e.to_string()))?;
        } else {
            Parser::<DefaultElement>::new()
                .read_payload_for_element(&mut reader, element, &header)
                .map_err(|e| broken(e.to_string()))?;
        }
    }
    let (vertices, with_normals) = contents.ok_or_else(|| PlyError::NoVertices {
        path: path.to_owned(),
    })?;
    let finite = |v: &Vertex| v.position.iter().all(|c| c.is_finite());
    if let Some(vertex) = vertices.iter().position(|v| !finite(v)) {
        return Err(PlyError::NotFinite {
            path: path.to_owned(),
            vertex,
        });
    }
    let mut triangles = Vec::with_capacity(faces.len());
    for (face, record) in faces.iter().enumerate() {
        let beyond = |&v: &u32| v as usize >= vertices.len();
        if record.negative || record.vertices.iter().any(beyond) {
            return Err(PlyError::Index {
                path: path.to_owned(),
                face,
                vertices: vertices.len(),
            });
        }
        if let [first, rest @ ..] = record.vertices.as_slice() {
            triangles.extend(rest.windows(2).map(|pair| [*first, pair[0], pair[1]]));
        }
    }
    let normals = if with_normals {
        vertices.iter().map(|v| Vector3::from(v.normal)).collect()
    } else {
        Vec::new()
    };
    let points = vertices.iter().map(|v| Point3::from(v.position)).collect();
    Ok(PlyContents {
        cloud: PointCloud { points, normals },
        triangles,
    })
}
