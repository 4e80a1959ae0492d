//! How far predictions can be trusted: intervals that contain the label of a new pose with a stated probability, and how unlike the training
//! images an image is.

mod familiarity;
mod intervals;
mod neighbours;

pub use familiarity::{Appearance, Familiarity};
pub use intervals::{ConfidenceError, IntervalBin, Intervals, coverage_of_left_out};
pub(crate) use neighbours::Neighbours;
