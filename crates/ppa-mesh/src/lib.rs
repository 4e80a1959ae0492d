//! Body surfaces from CT volumes.
//!
//! Units: mm. Frame: whatever frame the volume's affine leads to, normally `ct` (LPS).

mod body_shape;
mod dbscan;
mod estimate_normals;
mod limb;
mod mesh;
mod ply;
mod surface;
mod topology;

pub use body_shape::{Bump, BumpError, BumpSite, add_bumps, offset, seeded_bumps};
pub use dbscan::{Clusters, dbscan};
pub use estimate_normals::{CloudError, estimate_normals, mean_spacing_mm};
pub use limb::{
    Body, CutFace, Limb, LimbError, LimbReport, LimbSettings, VoxelBox, extract_limb,
};
pub use mesh::{Mesh, PointCloud};
pub use ply::{PlyContents, PlyError, read_ply, write_ply, write_ply_cloud};
pub use surface::{Border, SurfaceError, iso_surface};
pub use topology::Topology;
