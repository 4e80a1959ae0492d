//! Why a volume cannot be made.

use crate::grid::GridError;

/// Why a volume cannot be made.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum VolumeError {
    /// The lattice itself is unusable.
    #[error(transparent)]
    Grid(#[from] GridError),
    /// Number of values and number of voxels differ.
    #[error("{} for {}", ppa_core::text::count(*found, "value"), ppa_core::text::count(*expected, "voxel"))]
    Length {
        /// Values given.
        found: usize,
        /// Voxels of the grid.
        expected: usize,
    },
    /// A spacing to resample to is not a positive length.
    #[error("a spacing of {0} mm, expected a length above 0")]
    Spacing(f64),
    /// A spacing to resample to gives too many voxels.
    #[error("a spacing of {spacing_mm} mm gives {voxels:.1e} voxels, expected at most {most:.1e}")]
    TooFine {
        /// Spacing asked for, mm.
        spacing_mm: f64,
        /// Number of voxels that it gives.
        voxels: f64,
        /// Largest number of voxels.
        most: f64,
    },
    /// A spacing to resample to is more than twice a side of the volume.
    #[error(
        "a spacing of {spacing_mm} mm, expected at most about the volume's side of {side_mm} mm"
    )]
    TooCoarse {
        /// Spacing asked for, mm.
        spacing_mm: f64,
        /// The volume's side along that axis, mm.
        side_mm: f64,
    },
    /// A box whose ends are in the wrong order or not numbers.
    #[error("a box from {from_mm} to {to_mm} mm along {axis}, expected the smaller end first")]
    Reversed {
        /// `x`, `y` or `z`.
        axis: char,
        /// First end, LPS.
        from_mm: f64,
        /// Second end, LPS.
        to_mm: f64,
    },
    /// More voxels than fit in memory.
    #[error("not enough memory for {} and the data computed from them", ppa_core::text::count(*voxels, "voxel"))]
    Memory {
        /// Voxels asked for.
        voxels: usize,
    },
    /// A value is NaN or infinite.
    #[error("voxel ({}, {}, {}) holds a value that is not a number", .0[0], .0[1], .0[2])]
    NotFinite([usize; 3]),
}
