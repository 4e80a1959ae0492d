//! Errors of reading and writing mesh files.

use std::io;
use std::path::{Path, PathBuf};

/// Why a mesh or a cloud could not be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MeshFileError {
    /// The name does not give the format.
    #[error("{} does not end in .ply, .obj or .stl", path.display())]
    Extension {
        /// Path of the file.
        path: PathBuf,
    },
    /// The file cannot be opened.
    #[error("cannot open {}", path.display())]
    Open {
        /// Path of the file.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
    /// The file is not of that format or is truncated.
    #[error("{} is not a readable {format} file: {reason}", path.display())]
    Format {
        /// Path of the file.
        path: PathBuf,
        /// Name of the format.
        format: &'static str,
        /// Cause.
        reason: String,
    },
    /// The file has no points.
    #[error("{} has no vertices with x, y and z", path.display())]
    NoVertices {
        /// Path of the file.
        path: PathBuf,
    },
    /// A coordinate is NaN or infinite.
    #[error("vertex {vertex} of {} has a coordinate that is not a number", path.display())]
    NotFinite {
        /// Path of the file.
        path: PathBuf,
        /// Index of the vertex, from 0.
        vertex: usize,
    },
    /// A face names a vertex that does not exist.
    #[error("face {face} of {} refers to vertex {found}, but the number of vertices is {vertices}", path.display())]
    Index {
        /// Path of the file.
        path: PathBuf,
        /// Index of the face, from 0.
        face: usize,
        /// Vertex index as written in the file.
        found: String,
        /// Number of vertices.
        vertices: usize,
    },
    /// The format cannot hold points without triangles.
    #[error("{} cannot hold a cloud: STL files hold triangles only", path.display())]
    NoCloud {
        /// Path of the file.
        path: PathBuf,
    },
    /// The file cannot be written.
    #[error("cannot write {}", path.display())]
    Write {
        /// Path of the file.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
}

/// Fault in the contents of a file, without its path.
#[derive(Debug)]
pub enum Fault {
    Format {
        format: &'static str,
        reason: String,
    },
    NoVertices,
    NotFinite(usize),
    Index {
        face: usize,
        found: String,
        vertices: usize,
    },
}

impl MeshFileError {
    pub(super) fn in_file(path: &Path, fault: Fault) -> Self {
        let path = path.to_owned();
        match fault {
            Fault::Format { format, reason } => Self::Format {
                path,
                format,
                reason,
            },
            Fault::NoVertices => Self::NoVertices { path },
            Fault::NotFinite(vertex) => Self::NotFinite { path, vertex },
            Fault::Index {
                face,
                found,
                vertices,
            } => Self::Index {
                path,
                face,
                found,
                vertices,
            },
        }
    }
}
