//! Whether two loops of a cell bound one tube instead of two disks.
//!
//! The trilinear interpolant may connect two inside (or two outside) corners through the interior
//! of the cell though no face does. Corner values of a z-slice are linear in z and the sign of its
//! saddle is quadratic, so between consecutive roots nothing changes and following the
//! corners from interval to interval gives the exact connectivity.

use super::cell::{Configuration, Pattern, diagonal_cost, edge_corners, face_corners};

/// Corners (0, 0), (1, 0), (1, 1), (0, 1) of the slice z = 0.
const BOTTOM: [usize; 4] = [0, 1, 3, 2];

struct Labels(Vec<u32>);

impl Labels {
    fn new(n: usize) -> Self {
        Self((0..n as u32).collect())
    }

    fn find(&self, mut i: usize) -> usize {
        while self.0[i] as usize != i {
            i = self.0[i] as usize;
        }
        i
    }

    fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.find(a), self.find(b));
        self.0[a.max(b)] = a.min(b) as u32;
    }
}

/// The two loops of a pattern that bound a tube, if there is one.
pub fn tube(
    configuration: &Configuration,
    decisions: usize,
    pattern: &Pattern,
    values: &[f64; 8],
) -> Option<[usize; 2]> {
    let on_surface = surface_labels(configuration, decisions, values);
    let through = interior_labels(values);
    let ends = |at: usize| {
        let [a, b] = edge_corners(pattern.disks[at].ring[0]).map(usize::from);
        if values[a] >= 0.0 { [a, b] } else { [b, a] }
    };
    for first in 0..pattern.disks.len() {
        for second in first + 1..pattern.disks.len() {
            let (p, q) = (ends(first), ends(second));
            let apart = [0, 1].map(|s| on_surface.find(p[s]) != on_surface.find(q[s]));
            let joined = [0, 1].map(|s| through[p[s]] == through[q[s]]);
            // Adjacent to one common region, and the regions behind both are one in the interior.
            if (0..2).any(|side| apart[side] && joined[side] && !apart[1 - side]) {
                return Some([first, second]);
            }
        }
    }
    None
}

/// Components of equal sign as seen on the faces alone.
fn surface_labels(configuration: &Configuration, decisions: usize, values: &[f64; 8]) -> Labels {
    let inside = |corner: u8| values[corner as usize] >= 0.0;
    let mut labels = Labels::new(8);
    for edge in 0..12 {
        let [a, b] = edge_corners(edge);
        if inside(a) == inside(b) {
            labels.join(a as usize, b as usize);
        }
    }
    for (bit, &face) in configuration.ambiguous.iter().enumerate() {
        let [a, b, c, d] = face_corners(face);
        let joined_inside = decisions >> bit & 1 == 1;
        let (p, q) = if inside(a) == joined_inside { (a, c) } else { (b, d) };
        labels.join(p as usize, q as usize);
    }
    labels
}

/// Component of each corner among those of its sign, following the interpolant through the cell.
fn interior_labels(values: &[f64; 8]) -> [usize; 8] {
    let low = BOTTOM.map(|c| values[c]);
    let high = BOTTOM.map(|c| values[c + 4]);
    let slope = [0, 1, 2, 3].map(|m| high[m] - low[m]);
    let at = |z: f64| [0, 1, 2, 3].map(|m| low[m] + slope[m] * z);

    let mut events: Vec<f64> = (0..4)
        .filter(|&m| (low[m] >= 0.0) != (high[m] >= 0.0))
        .map(|m| low[m] / (low[m] - high[m]))
        .collect();
    let a = slope[0] * slope[2] - slope[1] * slope[3];
    let b = low[0] * slope[2] + low[2] * slope[0] - low[1] * slope[3] - low[3] * slope[1];
    let c = low[0] * low[2] - low[1] * low[3];
    let discriminant = b * b - 4.0 * a * c;
    if discriminant >= 0.0 {
        // The form without cancellation; a or b of zero gives an infinity that is dropped below.
        let q = -0.5 * (b + b.signum() * discriminant.sqrt());
        events.extend([q / a, c / q]);
    }
    events.retain(|z| 0.0 < *z && *z < 1.0);
    events.sort_by(f64::total_cmp);
    events.insert(0, 0.0);
    events.push(1.0);

    let intervals = events.len() - 1;
    let mut labels = Labels::new(4 * intervals);
    let mut below: Option<[bool; 4]> = None;
    for interval in 0..intervals {
        let v = at(0.5 * (events[interval] + events[interval + 1]));
        let inside = v.map(|value| value >= 0.0);
        for m in 0..4 {
            if inside[m] == inside[(m + 1) % 4] {
                labels.join(4 * interval + m, 4 * interval + (m + 1) % 4);
            }
            if below.is_some_and(|below| below[m] == inside[m]) {
                labels.join(4 * interval + m, 4 * (interval - 1) + m);
            }
        }
        if inside[0] == inside[2] && inside[1] == inside[3] && inside[0] != inside[1] {
            let saddle = v[0] * v[2] - v[1] * v[3];
            // Positive: the diagonal 0-2 is joined, whatever its sign.
            let first = if saddle >= 0.0 { 0 } else { 1 };
            labels.join(4 * interval + first, 4 * interval + first + 2);
        }
        below = Some(inside);
    }
    let mut result = [0; 8];
    for m in 0..4 {
        result[BOTTOM[m]] = labels.find(m);
        result[BOTTOM[m] + 4] = labels.find(4 * (intervals - 1) + m);
    }
    result
}

/// Triangles between two loops; `None` when every choice would need an edge within a face.
pub fn tube_triangles(first: &[u8], second: &[u8]) -> Option<Vec<[u8; 3]>> {
    // Both loops are oriented as borders of disks with the body on the same side, so across the
    // tube they run against each other.
    let back: Vec<u8> = second.iter().rev().copied().collect();
    let mut best: Option<(f64, Vec<[u8; 3]>)> = None;
    for shift in 0..back.len() {
        let turned: Vec<u8> = (0..back.len()).map(|i| back[(i + shift) % back.len()]).collect();
        if let Some(found) = zip(first, &turned)
            && best.as_ref().is_none_or(|(cost, _)| found.0 < *cost)
        {
            best = Some(found);
        }
    }
    best.map(|(_, triangles)| triangles)
}

/// Cheapest way to advance along `p` and `q` alternately, from (p0, q0) around to itself.
fn zip(p: &[u8], q: &[u8]) -> Option<(f64, Vec<[u8; 3]>)> {
    let (m, n) = (p.len(), q.len());
    let bridge = |i: usize, j: usize| diagonal_cost(p[i % m], q[j % n]);
    let mut cost = vec![vec![f64::INFINITY; n + 1]; m + 1];
    cost[0][0] = bridge(0, 0);
    for i in 0..=m {
        for j in 0..=n {
            if i + j > 0 {
                let from_p = if i > 0 { cost[i - 1][j] } else { f64::INFINITY };
                let from_q = if j > 0 { cost[i][j - 1] } else { f64::INFINITY };
                cost[i][j] = from_p.min(from_q) + bridge(i, j);
            }
        }
    }
    if !cost[m][n].is_finite() {
        return None;
    }
    let mut triangles = Vec::new();
    let (mut i, mut j) = (m, n);
    while i + j > 0 {
        if i > 0 && (j == 0 || cost[i - 1][j] <= cost[i][j - 1]) {
            triangles.push([p[i - 1], p[i % m], q[j % n]]);
            i -= 1;
        } else {
            triangles.push([p[i % m], q[j % n], q[j - 1]]);
            j -= 1;
        }
    }
    // The seam (p0, q0) must be used by two triangles only: both loops advance at least once.
    Some((cost[m][n], triangles))
}
