//! Flat and round surface patches, as triangles and as evenly spaced points.

use std::f64::consts::TAU;

use nalgebra::{Point3, Vector3};
use ppa_mesh::{Mesh, PointCloud};

use crate::room::plane::across;

/// A patch with unit parameters (u, v) in 0..=1 whose normal is ∂u × ∂v.
#[derive(Debug, Clone, Copy)]
enum Patch {
    /// origin + u·a + v·b
    Rectangle {
        origin: Point3<f64>,
        a: Vector3<f64>,
        b: Vector3<f64>,
    },
    /// Side of a cylinder: the angle runs with u, the axis with v.
    Side {
        base: Point3<f64>,
        axis: Vector3<f64>,
        radius: f64,
    },
    /// Lid of a cylinder with the outward normal `axis`: the angle runs with v, the radius with u.
    Lid {
        centre: Point3<f64>,
        axis: Vector3<f64>,
        radius: f64,
    },
}

/// Solid parts of a room, kept as patches with outward normals.
#[derive(Debug, Clone, Default)]
pub(crate) struct Parts {
    patches: Vec<Patch>,
}

/// Facets of a full circle: 3 mm from the true circle at a radius of 100 mm would be visible,
/// 0.1 mm is not.
const FACETS: usize = 72;

impl Parts {
    /// A rectangle seen from the side of a × b.
    pub(crate) fn rectangle(&mut self, origin: Point3<f64>, a: Vector3<f64>, b: Vector3<f64>) {
        self.patches.push(Patch::Rectangle { origin, a, b });
    }

    /// A box along the axes.
    pub(crate) fn cuboid(&mut self, low: Point3<f64>, high: Point3<f64>) {
        let d = high - low;
        let (x, y, z) = (Vector3::x() * d.x, Vector3::y() * d.y, Vector3::z() * d.z);
        for (a, b, c) in [(x, y, z), (y, z, x), (z, x, y)] {
            self.rectangle(low + c, a, b);
            self.rectangle(low, b, a);
        }
    }

    /// A cylinder from `base` to `base + axis`.
    pub(crate) fn cylinder(&mut self, base: Point3<f64>, axis: Vector3<f64>, radius: f64) {
        self.patches.push(Patch::Side { base, axis, radius });
        self.patches.push(Patch::Lid {
            centre: base + axis,
            axis,
            radius,
        });
        self.patches.push(Patch::Lid {
            centre: base,
            axis: -axis,
            radius,
        });
    }

    /// All patches as triangles, counter-clockwise seen from outside.
    pub(crate) fn mesh(&self) -> Mesh {
        let mut mesh = Mesh::default();
        for patch in &self.patches {
            let (nu, nv) = patch.facets();
            let first = mesh.vertices.len() as u32;
            for v in 0..=nv {
                for u in 0..=nu {
                    let (point, normal) = patch.at(u as f64 / nu as f64, v as f64 / nv as f64);
                    mesh.vertices.push(point.cast());
                    mesh.normals.push(normal.cast());
                }
            }
            let row = nu as u32 + 1;
            for v in 0..nv as u32 {
                for u in 0..nu as u32 {
                    let corner = first + v * row + u;
                    mesh.triangles.push([corner, corner + 1, corner + row + 1]);
                    // The inner edge of a lid is one point: no second triangle there.
                    if !matches!(patch, Patch::Lid { .. }) {
                        mesh.triangles
                            .push([corner, corner + row + 1, corner + row]);
                    }
                }
            }
        }
        mesh
    }

    /// Area of all patches, mm².
    pub(crate) fn area_mm2(&self) -> f64 {
        let area = |patch: &Patch| match patch {
            Patch::Rectangle { a, b, .. } => a.cross(b).norm(),
            Patch::Side { axis, radius, .. } => axis.norm() * TAU * radius,
            Patch::Lid { radius, .. } => 0.5 * TAU * radius * radius,
        };
        self.patches.iter().map(area).sum()
    }

    /// Points on all patches, about `spacing_mm` apart, in a fixed order.
    pub(crate) fn cloud(&self, spacing_mm: f64) -> PointCloud {
        let mut cloud = PointCloud::default();
        for patch in &self.patches {
            let rows = patch.rows(spacing_mm);
            for (row, columns) in rows.iter().enumerate() {
                let u = (row as f64 + 0.5) / rows.len() as f64;
                for column in 0..*columns {
                    let v = (column as f64 + 0.5) / *columns as f64;
                    let (point, normal) = patch.at(u, v);
                    cloud.points.push(point.cast());
                    cloud.normals.push(normal.cast());
                }
            }
        }
        cloud
    }
}

impl Patch {
    fn at(&self, u: f64, v: f64) -> (Point3<f64>, Vector3<f64>) {
        match self {
            Self::Rectangle { origin, a, b } => (origin + a * u + b * v, a.cross(b).normalize()),
            Self::Side { base, axis, radius } => {
                let (e1, e2) = across(axis);
                let (sin, cos) = (TAU * u).sin_cos();
                let out = e1 * cos + e2 * sin;
                (base + axis * v + out * *radius, out)
            }
            Self::Lid {
                centre,
                axis,
                radius,
            } => {
                let (e1, e2) = across(axis);
                let (sin, cos) = (TAU * v).sin_cos();
                let out = e1 * cos + e2 * sin;
                (centre + out * (*radius * u), axis.normalize())
            }
        }
    }

    /// Facets along u and v of the triangle mesh.
    fn facets(&self) -> (usize, usize) {
        match self {
            Self::Rectangle { .. } => (1, 1),
            Self::Side { .. } => (FACETS, 1),
            Self::Lid { .. } => (1, FACETS),
        }
    }

    /// Number of points in each row of constant u.
    fn rows(&self, spacing_mm: f64) -> Vec<usize> {
        let count = |length: f64| ((length / spacing_mm).round() as usize).max(1);
        match self {
            Self::Rectangle { a, b, .. } => vec![count(b.norm()); count(a.norm())],
            Self::Side { axis, radius, .. } => vec![count(axis.norm()); count(TAU * radius)],
            Self::Lid { radius, .. } => {
                let rings = count(*radius);
                (0..rings)
                    .map(|ring| count(TAU * radius * (ring as f64 + 0.5) / rings as f64))
                    .collect()
            }
        }
    }
}
