//! Distance between two shapes of a skin.

use std::iter::zip;

use nalgebra::Vector3;

use crate::mesh::Mesh;

/// Displacement between two meshes with the same triangles, such as a skin and its [`offset`](crate::offset).
#[derive(Debug, Clone, PartialEq)]
pub struct Displacement {
    /// How far each vertex moved, mm.
    pub shifts_mm: Vec<f64>,
    /// Volume swept outwards minus volume swept inwards, mm³: the increase of the enclosed volume. The
    /// volume that an open rim sweeps within its own opening does not count.
    pub volume_mm3: f64,
}

impl Displacement {
    /// Displacement from `before` to `after`, which must have as many vertices and the same triangles.
    ///
    /// The rate of change of volume, triangles' vector areas times the mean shift of their corners, is
    /// quadratic in the fraction of the displacement, so Simpson's rule integrates it exactly.
    pub fn between(before: &Mesh, after: &Mesh) -> Self {
        let shift = |v: u32| {
            let [from, to] = [before, after].map(|mesh| mesh.vertices[v as usize].cast::<f64>());
            to - from
        };
        let mut volume_mm3 = 0.0;
        for triangle in &before.triangles {
            let shifts = triangle.map(shift);
            let mean = shifts.iter().sum::<Vector3<f64>>() / 3.0;
            let corners = before.corners(triangle);
            let rate = |part: f64| {
                let [a, b, c] = [0, 1, 2].map(|at| corners[at] + shifts[at] * part);
                0.5 * (b - a).cross(&(c - a)).dot(&mean)
            };
            volume_mm3 += (rate(0.0) + 4.0 * rate(0.5) + rate(1.0)) / 6.0;
        }
        let pairs = zip(&before.vertices, &after.vertices);
        Self {
            shifts_mm: pairs
                .map(|(from, to)| (to.cast::<f64>() - from.cast::<f64>()).norm())
                .collect(),
            volume_mm3,
        }
    }

    /// Smallest, mean and largest shift, mm; 0 without vertices.
    pub fn least_mean_most_mm(&self) -> [f64; 3] {
        let shifts = || self.shifts_mm.iter().copied();
        let count = self.shifts_mm.len().max(1) as f64;
        let most = shifts().fold(0.0, f64::max);
        [
            shifts().fold(most, f64::min),
            shifts().sum::<f64>() / count,
            most,
        ]
    }
}
