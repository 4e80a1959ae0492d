//! Extra vertices inside a cell, for loops and tubes that triangles between crossings cannot fill.

use nalgebra::Vector3;

use super::cell::edge_corners;
use super::field::Sample;
use super::march::March;

impl<T: Sample> March<'_, T> {
    /// Where a cell edge is crossed, and the gradient there.
    fn crossing(&self, voxel: [usize; 3], edge: u8) -> (Vector3<f64>, Vector3<f32>) {
        let [a, b] = edge_corners(edge).map(|corner| {
            let corner = usize::from(corner);
            [0, 1, 2].map(|axis| voxel[axis] + (corner >> axis & 1))
        });
        let (va, vb) = [a, b].map(|v| self.field.above(v)).into();
        let t = va / (va - vb);
        let [p, q] = [a, b].map(|v| Vector3::from(v.map(|c| c as f64)));
        let [near, far] =
            [a, b].map(|[i, j, k]| Vector3::from(self.field.stencil(j, k).gradient(i)));
        (p + (q - p) * t, near + (far - near) * t as f32)
    }

    /// Mean crossing and gradient of a ring.
    pub fn middle(&self, voxel: [usize; 3], ring: &[u8]) -> (Vector3<f64>, Vector3<f32>) {
        let (mut position, mut gradient) = (Vector3::zeros(), Vector3::zeros());
        for &edge in ring {
            let (p, g) = self.crossing(voxel, edge);
            position += p;
            gradient += g;
        }
        (position / ring.len() as f64, gradient / ring.len() as f32)
    }

    /// A tube between two rings with a ring of extra vertices half-way, none of which lies in a
    /// face of the cell, so that every bridge is allowed.
    pub fn waist(&mut self, voxel: [usize; 3], edges: [&[u8]; 2], [first, second]: [Vec<u32>; 2]) {
        let [here, there] = edges.map(|ring| self.middle(voxel, ring).0);
        let shift = 0.5 * (there - here);
        let narrowed = |position| here + shift + 0.5 * (position - here);
        let waist: Vec<u32> = edges[0]
            .iter()
            .map(|&edge| {
                let (position, gradient) = self.crossing(voxel, edge);
                self.push(narrowed(position), gradient)
            })
            .collect();
        let (m, n) = (waist.len(), second.len());
        for at in 0..m {
            let next = (at + 1) % m;
            self.triangle([first[at], first[next], waist[at]]);
            self.triangle([first[next], waist[next], waist[at]]);
        }
        // The second ring runs the other way; both are paced evenly from their nearest vertices.
        let back: Vec<u32> = second.iter().rev().copied().collect();
        let positions: Vec<_> = edges[1]
            .iter()
            .rev()
            .map(|&edge| self.crossing(voxel, edge).0)
            .collect();
        let start = narrowed(self.crossing(voxel, edges[0][0]).0);
        let away = |at: &usize| (positions[*at] - start).norm();
        let turn = (0..n)
            .min_by(|a, b| away(a).total_cmp(&away(b)))
            .unwrap_or(0);
        let (mut i, mut j) = (0, 0);
        while i < m || j < n {
            let (p, q) = (waist[i % m], back[(j + turn) % n]);
            if j == n || (i < m && i * n <= j * m) {
                i += 1;
                self.triangle([p, waist[i % m], q]);
            } else {
                j += 1;
                self.triangle([p, back[(j + turn) % n], q]);
            }
        }
    }
}
