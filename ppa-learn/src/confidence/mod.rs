//! Confidence of predictions: intervals that contain the label of a new pose with a stated probability, and detection of images
//! outside the distribution of the training images.

mod intervals;
mod neighbours;
mod out_of_distribution;

pub use intervals::{ConfidenceError, IntervalBin, Intervals, coverage_of_left_out};
pub(crate) use neighbours::Neighbours;
pub use out_of_distribution::{Descriptors, OutOfDistributionDetector};
