//! Where a ray from the camera meets a triangle, without leaks between neighbours.

use nalgebra::{Point3, Vector2, Vector3};

/// A triangle in the camera frame, prepared for rays (x, y, 1) from the origin.
///
/// A ray passes inside if it lies on one side of the three planes through the origin and an edge: homogeneous edge functions
/// (Olano, Greer, Triangle Scan Conversion using 2D Homogeneous Coordinates, 1997), which need no clipping. Two triangles
/// that share an edge evaluate the same function with opposite sign, to the last bit, so that no ray passes between them.
pub(crate) struct Triangle {
    edges: [Vector3<f64>; 3],
    normal: Vector3<f64>,
    /// Of the triangle's plane from the origin, times the length of `normal`.
    distance: f64,
}

impl Triangle {
    #[inline]
    pub(crate) fn new([a, b, c]: [Point3<f64>; 3]) -> Self {
        let normal = (b - a).cross(&(c - a));
        Self {
            edges: [
                b.coords.cross(&c.coords),
                c.coords.cross(&a.coords),
                a.coords.cross(&b.coords),
            ],
            normal,
            distance: normal.dot(&a.coords),
        }
    }

    /// Depth z > 0 at which the ray meets the triangle, its edges and corners included.
    #[inline]
    pub(crate) fn depth(&self, ray: &Vector2<f64>) -> Option<f64> {
        let along = |v: &Vector3<f64>| v.x * ray.x + v.y * ray.y + v.z;
        let [u, v, w] = [
            along(&self.edges[0]),
            along(&self.edges[1]),
            along(&self.edges[2]),
        ];
        if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
            return None;
        }
        let slope = along(&self.normal);
        if slope == 0.0 {
            return None; // seen edge-on, or without area: its neighbours cover it
        }
        let z = self.distance / slope;
        (z > 0.0 && z.is_finite()).then_some(z)
    }
}
