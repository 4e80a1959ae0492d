//! Errors of networks.

/// Error in running a network.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum NetworkError {
    /// Images of a different number of cameras than the network takes.
    #[error("the network expects images of {}, found images of {found}", ppa_core::text::count(*expected, "camera"))]
    Cameras {
        /// Number of cameras whose images were given.
        found: usize,
        /// Number of cameras that the network takes.
        expected: usize,
    },
    /// Networks of two cameras of which only one predicts corrections.
    #[error("only one of the two networks predicts corrections")]
    Targets,
    /// Images of another shape.
    #[error(
        "images have the shape {found:?}, expected [images, 1, height, width] with no empty dimension"
    )]
    Shape {
        /// The shape found.
        found: Vec<usize>,
    },
    /// One value for each channel has no variance.
    #[error(
        "training on {} of {height} x {width} leaves one value for each channel, which has no variance; expected more images or more than 32 pixels on a side",
        ppa_core::text::count(*images, "image")
    )]
    OneValue {
        /// Images in the batch.
        images: usize,
        /// Rows of an image.
        height: usize,
        /// Columns of an image.
        width: usize,
    },
    /// An error of candle.
    #[error("a computation in the network failed")]
    Candle(#[from] candle_core::Error),
}
