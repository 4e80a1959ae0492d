//! Why there is no room.

/// Why there is no room.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RoomError {
    /// A length of the built-in room does not make sense.
    #[error("{name} of the room is {found} mm, expected {expected}")]
    Length {
        /// Field of [`RoomSpec`](crate::RoomSpec).
        name: &'static str,
        /// Its value.
        found: f64,
        /// What it should be.
        expected: &'static str,
    },
    /// A file cannot be read, or holds no points.
    #[error(transparent)]
    Ply(#[from] ppa_mesh::MeshFileError),
}
