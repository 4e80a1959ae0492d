//! The x-ray room: built in from a few lengths, or recorded by a user.

use std::path::Path;

use ppa_mesh::{Mesh, PointCloud};

use crate::room::device::XrayDevice;
use crate::room::error::RoomError;
use crate::room::spec::RoomSpec;

/// Largest number of points in a room's cloud, 24 bytes each.
const MOST_POINTS: f64 = 2e7;

/// An x-ray room with its device.
#[derive(Debug, Clone, PartialEq)]
pub struct XrayRoom {
    /// Its surfaces as points, room frame.
    pub cloud: PointCloud,
    /// The same surfaces as triangles, when they are known.
    pub mesh: Option<Mesh>,
    /// The x-ray device.
    pub device: XrayDevice,
}

impl XrayRoom {
    /// Builds the room that a spec describes: table, detector, tube housing with collimator,
    /// arm and column, floor and two walls.
    ///
    /// # Errors
    /// [`RoomError::Length`] for lengths that are not positive or do not fit together.
    pub fn parametric(spec: &RoomSpec) -> Result<Self, RoomError> {
        spec.check()?;
        let source_z = spec.source_mm();
        let parts = spec.parts(source_z);
        let points = parts.area_mm2() / spec.point_spacing_mm.powi(2);
        if points > MOST_POINTS {
            return Err(RoomError::Length {
                name: "point_spacing_mm",
                found: spec.point_spacing_mm,
                expected: "a spacing that gives the room at most 20 million points",
            });
        }
        Ok(Self {
            cloud: parts.cloud(spec.point_spacing_mm),
            mesh: Some(parts.mesh()),
            device: XrayDevice::overhead(source_z, spec.source_detector_mm),
        })
    }

    /// The room's points and triangles in one mesh, so that one file holds both: points first, which no triangle of the
    /// built-in room uses. `None` without triangles.
    pub fn points_and_triangles(&self) -> Option<Mesh> {
        let triangles = self.mesh.as_ref()?;
        let cloud = &self.cloud;
        // The points of a recorded room are the corners of its triangles.
        if triangles.vertices == cloud.points {
            return Some(triangles.clone());
        }
        let first = cloud.points.len() as u32;
        let moved = |corners: &[u32; 3]| corners.map(|corner| corner + first);
        Some(Mesh {
            vertices: [&cloud.points[..], &triangles.vertices].concat(),
            normals: [&cloud.normals[..], &triangles.normals].concat(),
            triangles: triangles.triangles.iter().map(moved).collect(),
        })
    }

    /// Reads a recorded room from a PLY, OBJ or STL file in mm; its frame becomes the room frame.
    ///
    /// Triangles are kept if the file has any. The device is given, as no cloud contains it.
    ///
    /// # Errors
    /// [`RoomError`] when the file is missing, broken or empty.
    pub fn from_ply(path: impl AsRef<Path>, device: XrayDevice) -> Result<Self, RoomError> {
        let contents = ppa_mesh::read_mesh_file(path.as_ref())?;
        let cloud = contents.cloud.clone();
        let mesh = (!contents.triangles.is_empty()).then(|| contents.into_mesh());
        Ok(Self {
            cloud,
            mesh,
            device,
        })
    }
}
