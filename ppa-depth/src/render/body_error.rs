//! Checks of the points and triangles of a body.

/// Why points or triangles do not make a body.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BodyError {
    /// No triangle or no point.
    #[error("the surface is empty: no {0}")]
    Empty(&'static str),
    /// A coordinate is infinite, NaN, or beyond 1e6 mm.
    #[error("point {index} is at ({}, {}, {}), expected finite coordinates within 1e6 mm", found[0], found[1], found[2])]
    Coordinate {
        /// Index of the vertex or point.
        index: usize,
        /// Its coordinates, mm.
        found: [f32; 3],
    },
    /// A triangle refers to a vertex that does not exist.
    #[error("triangle {triangle} uses vertex {vertex}, but the number of vertices is {vertices}")]
    Vertex {
        /// Index of the triangle.
        triangle: usize,
        /// Index of the vertex.
        vertex: u32,
        /// Number of vertices.
        vertices: usize,
    },
    /// More primitives than the index can number.
    #[error("the surface has {0} triangles or points, expected fewer than 2^31")]
    TooMany(usize),
    /// Points and normals differ in number.
    #[error("{points} points but {normals} normals")]
    NormalCount {
        /// Points found.
        points: usize,
        /// Normals found.
        normals: usize,
    },
    /// A normal has no direction.
    #[error("normal {index} is ({}, {}, {}), expected a vector with a direction", found[0], found[1], found[2])]
    Normal {
        /// Index of the normal.
        index: usize,
        /// Its components.
        found: [f32; 3],
    },
    /// A closed mesh surrounds the camera.
    #[error("the camera is inside the surface, at ({}, {}, {}) mm in its frame (check the pose)", eye[0], eye[1], eye[2])]
    CameraInside {
        /// Position of the camera in the frame of the body, mm.
        eye: [f64; 3],
    },
    /// A pose that is not finite or too far away.
    #[error("the surface is moved by ({}, {}, {}) mm, expected finite numbers within 1e9 mm", .0[0], .0[1], .0[2])]
    Pose([f64; 3]),
    /// The disc radius is zero, negative, not finite or beyond 1e6 mm.
    #[error("disc radius {0} mm, expected a positive number up to 1e6")]
    Radius(f64),
}

/// Largest coordinate of a body, mm: a kilometre.
pub(crate) const MAX_COORDINATE_MM: f32 = 1e6;

/// The largest absolute coordinate, if all points are within the allowed range.
pub(crate) fn check_points(points: &[nalgebra::Point3<f32>]) -> Result<f32, BodyError> {
    // The bits of |x| are ordered as |x| is, with NaN on top, and their maximum is found in vector code.
    let bits = |point: &nalgebra::Point3<f32>| point.coords.map(|x| x.abs().to_bits()).max();
    let reach_mm = f32::from_bits(points.iter().map(bits).max().unwrap_or(0));
    if reach_mm <= MAX_COORDINATE_MM {
        return Ok(reach_mm);
    }
    let outside = |value: &f32| value.is_nan() || value.abs() > MAX_COORDINATE_MM;
    let index = points
        .iter()
        .position(|point| point.iter().any(outside))
        .unwrap_or_default();
    Err(BodyError::Coordinate {
        index,
        found: points[index].into(),
    })
}

/// Whether the number of primitives fits the index.
pub(crate) fn check_count(count: usize, what: &'static str) -> Result<(), BodyError> {
    match count {
        0 => Err(BodyError::Empty(what)),
        count if count >= 1 << 31 => Err(BodyError::TooMany(count)),
        _ => Ok(()),
    }
}
