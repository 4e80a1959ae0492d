//! Interpolation of the density between the centres of voxels.

/// How density varies between the centres of voxels.
///
/// Written in lower case in plans: `"nearest"`, `"trilinear"`.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Hash, Default, serde::Serialize, serde::Deserialize,
)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Interpolation {
    /// Every voxel is homogeneous, as in MC-GPU: a phantom of exact boxes.
    #[default]
    Nearest,
    /// The density of every material is trilinear between the centres of voxels, and constant in the outer half of the outermost ones:
    /// samples of a continuous body, such as a CT. Surfaces have no steps, and the mass of every voxel is that of its
    /// density.
    Trilinear,
}

impl Interpolation {
    /// Number of voxels around the voxel at a point that contribute to the density there.
    pub(crate) fn halo(self) -> usize {
        match self {
            Self::Nearest => 0,
            Self::Trilinear => 1,
        }
    }
}
