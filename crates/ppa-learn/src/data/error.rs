//! What can be wrong with images and labels.

/// An image, a region or a label that cannot be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DataError {
    /// The number of values is not columns times rows, or there is none.
    #[error("an image of {width} x {height} pixels has {found} values")]
    Length {
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
        /// Values found.
        found: usize,
    },
    /// The region of interest has no pixel within the image.
    #[error(
        "the region of {size} x {size} pixels from column {x} and row {y} lies outside the image of {width} x {height}"
    )]
    RoiOutside {
        /// First column of the region.
        x: u32,
        /// First row of the region.
        y: u32,
        /// Columns and rows of the region.
        size: u32,
        /// Columns of the image.
        width: usize,
        /// Rows of the image.
        height: usize,
    },
}
