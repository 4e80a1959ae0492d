//! Triangle meshes, met by rays without leaks.

use nalgebra::{Point3, Vector3};

use crate::body::{BodyError, check_count, check_points};
use crate::nearest::{Index, Ray};

/// A triangle mesh in its own frame, mm. Both sides of a triangle are seen, so the orientation does not matter.
#[derive(Debug, Clone)]
pub struct MeshBody {
    vertices: Vec<Point3<f32>>,
    triangles: Vec<[u32; 3]>,
    index: Index,
}

impl MeshBody {
    /// Copies and indexes the mesh: about a microsecond per triangle.
    ///
    /// # Errors
    /// [`BodyError`] for no triangle, a coordinate that is not finite, or a triangle that names a missing vertex.
    pub fn new(vertices: &[Point3<f32>], triangles: &[[u32; 3]]) -> Result<Self, BodyError> {
        check_count(triangles.len(), "triangle")?;
        check_points(vertices)?;
        for (triangle, corners) in triangles.iter().enumerate() {
            if let Some(&vertex) = corners
                .iter()
                .find(|&&corner| corner as usize >= vertices.len())
            {
                return Err(BodyError::Vertex {
                    triangle,
                    vertex,
                    vertices: vertices.len(),
                });
            }
        }
        let index = Index::new(triangles.iter().map(|corners| {
            let [a, b, c] = corners.map(|corner| vertices[corner as usize]);
            [a.inf(&b).inf(&c), a.sup(&b).sup(&c)]
        }));
        Ok(Self {
            vertices: vertices.to_vec(),
            triangles: triangles.to_vec(),
            index,
        })
    }

    pub(crate) fn nearest(&self, ray: &Ray, limit: f64) -> Option<f64> {
        let sheared = ShearedRay::new(ray);
        self.index.nearest(ray, limit, |triangle| {
            let corners = self.triangles[triangle as usize]
                .map(|corner| self.vertices[corner as usize].cast());
            sheared.meets(&corners)
        })
    }
}

/// Watertight ray-triangle test: Woop, Benthin, Wald, Watertight Ray/Triangle Intersection, JCGT 2 (2013), in f64.
///
/// The ray is made the z axis of a sheared frame. Two triangles that share an edge then evaluate the same edge function
/// with opposite sign, to the last bit, so that no ray passes between them.
struct ShearedRay {
    origin: Point3<f64>,
    /// Axes of the body that become x, y, z; z is the ray's largest component.
    axes: [usize; 3],
    shear: [f64; 2],
    scale: f64,
}

impl ShearedRay {
    fn new(ray: &Ray) -> Self {
        let z = ray.direction.iamax();
        let axes = [(z + 1) % 3, (z + 2) % 3, z];
        let [dx, dy, dz] = axes.map(|axis| ray.direction[axis]);
        Self {
            origin: ray.origin,
            axes,
            shear: [dx / dz, dy / dz],
            scale: 1.0 / dz,
        }
    }

    /// t > 0 at which the ray meets the triangle, its edges and corners included.
    fn meets(&self, corners: &[Point3<f64>; 3]) -> Option<f64> {
        let [kx, ky, kz] = self.axes;
        let [(ax, ay, az), (bx, by, bz), (cx, cy, cz)] = corners.map(|corner| {
            let p: Vector3<f64> = corner - self.origin;
            (
                p[kx] - self.shear[0] * p[kz],
                p[ky] - self.shear[1] * p[kz],
                p[kz],
            )
        });
        let (u, v, w) = (cx * by - cy * bx, ax * cy - ay * cx, bx * ay - by * ax);
        if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
            return None;
        }
        let determinant = u + v + w;
        if determinant == 0.0 {
            return None; // seen edge-on, or without area: its neighbours cover it
        }
        let t = self.scale * (u * az + v * bz + w * cz) / determinant;
        (t > 0.0).then_some(t)
    }
}
