//! Errors in images, labels and splits.

use std::path::PathBuf;

use ppa_dataset::published::{ImageFileError, PublishedError};

/// Error in images, regions, labels or splits.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DataError {
    /// The number of values is not columns times rows, or is 0.
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
    /// An image whose region cannot be cut out.
    #[error("{}", path.display())]
    Region {
        /// The image.
        path: PathBuf,
        /// The cause.
        source: Box<DataError>,
    },
    /// An image whose size differs from that of the other images of its camera.
    #[error("{} has {}x{} pixels, expected {}x{} as in the other images of its camera", path.display(), found[0], found[1], expected[0], expected[1])]
    Size {
        /// The image.
        path: PathBuf,
        /// Its columns and rows.
        found: [usize; 2],
        /// Columns and rows of the camera's first image.
        expected: [usize; 2],
    },
    /// A depth image without region of interest.
    #[error("{} has no region of interest in roi_depth.json", .0.display())]
    NoRoi(PathBuf),
    /// A depth image without label.
    #[error("{} has no label in {labels}", image.display())]
    NoLabel {
        /// The image.
        image: PathBuf,
        /// Name of the label file.
        labels: String,
    },
    /// A label outside the scale.
    #[error("{sample} has the label {label}, expected 1 to 3")]
    Label {
        /// The sample.
        sample: String,
        /// Its label.
        label: f64,
    },
    /// Nothing to train or evaluate on.
    #[error("there is no image {0}")]
    Empty(String),
    /// A person on both sides of a split.
    #[error("{0} would be in both training and evaluation; a person must be in only one of them")]
    Leak(String),
    /// A file that is not a depth image.
    #[error(transparent)]
    Image(#[from] ImageFileError),
    /// A folder that is not a dataset.
    #[error(transparent)]
    Dataset(#[from] PublishedError),
}
