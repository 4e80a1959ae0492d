//! Placement of a drawn shape.

use nalgebra::Similarity3;

/// Similarity transform of a drawn shape, `limb_from_drawing`.
pub(super) type Placement = Similarity3<f64>;
