//! Body surfaces from CT volumes.
//!
//! Units: mm. Frame: whatever frame the volume's affine leads to, normally `ct` (LPS).

mod mesh;

pub use mesh::{Mesh, PointCloud};
