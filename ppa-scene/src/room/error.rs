//! Errors of x-ray rooms.

/// Reason why there is no room.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RoomError {
    /// A length of the built-in room is out of range.
    #[error("{name} of the room is {found} mm, expected {expected}")]
    Length {
        /// Field of [`RoomSpec`](crate::RoomSpec).
        name: &'static str,
        /// Its value.
        found: f64,
        /// What it should be.
        expected: &'static str,
    },
    /// A file cannot be read, or has no points.
    #[error(transparent)]
    Ply(#[from] ppa_mesh::MeshFileError),
}
