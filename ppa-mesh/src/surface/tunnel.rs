//! Test whether two loops of a cell bound one tube instead of two disks.
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
        let (p, q) = if inside(a) == joined_inside {
            (a, c)
        } else {
            (b, d)
        };
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
    let mut zipper = Zipper {
        p: first,
        q: back.clone(),
        steps: Vec::new(),
        best: None,
    };
    for shift in 0..back.len() {
        zipper.q = (0..back.len())
            .map(|i| back[(i + shift) % back.len()])
            .collect();
        zipper.advance([0, 0], diagonal_cost(first[0], zipper.q[0]));
    }
    zipper.best.map(|(_, triangles)| triangles)
}

/// Tries all ways to advance along `p` and `q` alternately, once around.
struct Zipper<'a> {
    p: &'a [u8],
    q: Vec<u8>,
    /// Whether each step so far went along `p`.
    steps: Vec<bool>,
    best: Option<(f64, Vec<[u8; 3]>)>,
}

impl Zipper<'_> {
    fn advance(&mut self, [i, j]: [usize; 2], cost: f64) {
        let (m, n) = (self.p.len(), self.q.len());
        let known = self.best.as_ref().map_or(f64::INFINITY, |(cost, _)| *cost);
        if cost >= known {
            return;
        }
        if [i, j] == [m, n] {
            if let Some(triangles) = self.triangles() {
                self.best = Some((cost, triangles));
            }
            return;
        }
        for (along_p, next) in [(true, [i + 1, j]), (false, [i, j + 1])] {
            if next[0] <= m && next[1] <= n {
                let bridge = diagonal_cost(self.p[next[0] % m], self.q[next[1] % n]);
                self.steps.push(along_p);
                self.advance(next, cost + bridge);
                self.steps.pop();
            }
        }
    }

    /// The strip of the steps taken, unless it uses one bridge twice.
    fn triangles(&self) -> Option<Vec<[u8; 3]>> {
        let (m, n) = (self.p.len(), self.q.len());
        let (mut i, mut j) = (0, 0);
        let mut bridges = Vec::new();
        let mut triangles = Vec::new();
        for &along_p in &self.steps {
            let bridge = (i % m, j % n);
            if bridges.contains(&bridge) {
                return None;
            }
            bridges.push(bridge);
            let (p, q) = (self.p[i % m], self.q[j % n]);
            if along_p {
                i += 1;
                triangles.push([p, self.p[i % m], q]);
            } else {
                j += 1;
                triangles.push([p, self.q[j % n], q]);
            }
        }
        Some(triangles)
    }
}
