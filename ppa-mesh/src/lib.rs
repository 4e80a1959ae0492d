//! Body surfaces from CT volumes.
//!
//! [`iso_surface`] turns a volume into a triangle [`Mesh`]; [`extract_limb`] finds the limb in a scan
//! and cuts couch, sheets and neighbours; [`offset`], [`add_bumps`] and [`seeded_bumps`] make other
//! body shapes from it; [`Displacement`] measures the change; [`dbscan`] clusters points; [`write_mesh_file`], [`write_cloud_file`] and
//! [`read_mesh_file`] exchange meshes and clouds with other programs as PLY, OBJ and STL.
//!
//! Units: mm, HU. Frame: that of the volume's affine, normally `ct` (LPS).
//! Triangles are counter-clockwise seen from outside and normals point outward.
//! Repeatable: the same input gives the same vertices in the same order for any number of threads.
//! Not included: decimation and other file formats.

mod body_shape;
mod compiled_with;
mod dbscan;
mod displacement;
mod estimate_normals;
mod limb;
mod mesh;
mod mesh_file;
mod neighbours;
mod point_cells;
mod self_crossings;
mod shift_limit;
mod smooth_normals;
mod surface;
mod topology;

pub use body_shape::{Bump, BumpSite, ShapeError, add_bumps, offset, seeded_bumps};
pub use compiled_with::compiled_with;
pub use dbscan::{Clusters, dbscan};
pub use displacement::Displacement;
pub use estimate_normals::{CloudError, estimate_normals, mean_spacing_mm};
pub use limb::{
    Ball, Body, CutFace, CutWalls, Limb, LimbError, LimbReport, LimbSettings, VoxelBox,
    WallMeasure, extract_limb, toggle_body,
};
pub use mesh::{Mesh, PointCloud};
pub use mesh_file::{
    MeshContents, MeshFileError, read_mesh_file, write_cloud_file, write_mesh_file,
};
pub use surface::{Border, SurfaceError, iso_surface, iso_surfaces};
pub use topology::Topology;
