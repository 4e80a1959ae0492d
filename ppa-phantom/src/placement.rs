//! Placement of a drawn shape.

use nalgebra::Similarity3;

/// Where a drawn shape goes: `limb_from_drawing`, lengths times its scaling.
pub(super) type Placement = Similarity3<f64>;
