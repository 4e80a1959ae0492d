//! Why a file of a mesh could not be read or written.

use std::io;
use std::path::{Path, PathBuf};

/// Why a mesh or a cloud could not be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MeshFileError {
    /// The name does not give the format.
    #[error("{} does not end in .ply, .obj or .stl", path.display())]
    Extension {
        /// File asked for.
        path: PathBuf,
    },
    /// The file cannot be opened.
    #[error("cannot open {}", path.display())]
    Open {
        /// File asked for.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// Not a file of that format, or cut short.
    #[error("{} is not a readable {format} file: {reason}", path.display())]
    Format {
        /// File asked for.
        path: PathBuf,
        /// Name of the format.
        format: &'static str,
        /// What was found.
        reason: String,
    },
    /// No points.
    #[error("{} has no vertices with x, y and z", path.display())]
    NoVertices {
        /// File asked for.
        path: PathBuf,
    },
    /// A coordinate is NaN or infinite.
    #[error("vertex {vertex} of {} has a coordinate that is not a number", path.display())]
    NotFinite {
        /// File asked for.
        path: PathBuf,
        /// Index of the vertex, from 0.
        vertex: usize,
    },
    /// A face names a vertex that does not exist.
    #[error("face {face} of {} refers to vertex {found}, but the number of vertices is {vertices}", path.display())]
    Index {
        /// File asked for.
        path: PathBuf,
        /// Index of the face, from 0.
        face: usize,
        /// What it names, as it stands in the file.
        found: String,
        /// Number of vertices.
        vertices: usize,
    },
    /// The format has no room for points without triangles.
    #[error("{} cannot hold a cloud: STL files hold triangles only", path.display())]
    NoCloud {
        /// File asked for.
        path: PathBuf,
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

/// What is wrong with the contents of a file, wherever it lies.
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
