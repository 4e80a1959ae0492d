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
    /// Distance of the triangle's plane from the origin, times the length of `normal`.
    distance: f64,
    /// Smallest and largest depth of its corners, a little widened.
    range: [f64; 2],
}

/// Relative slack of the range of depths, far above rounding.
const SLACK: f64 = 1e-6;

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
            range: [
                a.z.min(b.z).min(c.z) * (1.0 - SLACK),
                a.z.max(b.z).max(c.z) * (1.0 + SLACK),
            ],
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
        // Exactly edge-on, distance and slope are both rounding errors.
        let [low, high] = self.range;
        (z > 0.0 && low <= z && z <= high).then_some(z)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The plane y = 0.7 x holds the eye, so that such rays run within it: distance and slope are rounding alone.
    #[test]
    fn a_triangle_seen_edge_on_has_no_depth_outside_its_own() {
        let mut found = 0;
        for i in 0..20_000 {
            let share = |k: f64| (f64::from(i) * k).fract();
            let corner = |a: f64, z: f64| Point3::new(a, 0.7 * a, z);
            let corners = [
                corner(-300.0 * share(0.618), 434.0 + share(0.713)),
                corner(200.0 * share(0.414), 900.0 * share(0.29) + 435.0),
                corner(500.0 * share(0.732), 1440.0),
            ];
            let x = 0.3 * share(0.577) - 0.1;
            if let Some(z) = Triangle::new(corners).depth(&Vector2::new(x, 0.7 * x)) {
                assert!((433.0..1441.0).contains(&z), "{z}");
                found += 1;
            }
        }
        println!("{found} of 20000 rays have a depth at all");
    }
}
