//! A body given by star-shaped cross-sections along an axis.

use std::f64::consts::TAU;

use nalgebra::{Isometry3, Point3, Vector2, Vector3};

use super::bounds::Bounds;
use super::placement::Placement;
pub(super) use super::section::Section;
use super::section::{ANGLES, catmull_rom};
use super::smooth::smooth_max;

/// End of a loft.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum End {
    /// Continues with its last section.
    Open,
    /// Cut square, the edge rounded over this many mm.
    Capped { blend: f64 },
}

/// Cross-sections joined by cubics in angle and along the axis.
///
/// The distance estimate divides the radial excess by the length of its gradient, which makes it
/// exact to first order at the surface.
#[derive(Debug, Clone)]
pub(super) struct Loft {
    /// Local axes: sections in the first two, stations along the third.
    local_from_limb: Isometry3<f64>,
    sections: Vec<Section>,
    first: End,
    last: End,
}

impl Loft {
    /// Sections in increasing order of station; at least two.
    pub(super) fn new(
        local_from_limb: Isometry3<f64>,
        sections: Vec<Section>,
        first: End,
        last: End,
    ) -> Self {
        debug_assert!(sections.windows(2).all(|w| w[0].station < w[1].station));
        Self {
            local_from_limb,
            sections,
            first,
            last,
        }
    }

    /// The loft at another place, size and orientation.
    pub(super) fn placed(&self, to: &Placement) -> Self {
        let size = to.scaling();
        let mut local_from_limb = self.local_from_limb;
        local_from_limb.translation.vector *= size;
        let end = |end| match end {
            End::Open => End::Open,
            End::Capped { blend } => End::Capped {
                blend: blend * size,
            },
        };
        Self {
            local_from_limb: local_from_limb * to.isometry.inverse(),
            sections: self.sections.iter().map(|s| s.resized(size)).collect(),
            first: end(self.first),
            last: end(self.last),
        }
    }

    /// Hermite weights of the sections around `s` and their derivatives by `s`.
    fn station_weights(&self, s: f64) -> (usize, [f64; 4], [f64; 4]) {
        let n = self.sections.len();
        let station = |i: usize| self.sections[i].station;
        if s <= station(0) {
            return (0, [0.0, 1.0, 0.0, 0.0], [0.0; 4]);
        }
        if s >= station(n - 1) {
            return (n - 2, [0.0, 0.0, 1.0, 0.0], [0.0; 4]);
        }
        let i = self.sections.partition_point(|c| c.station <= s) - 1;
        let width = station(i + 1) - station(i);
        let t = (s - station(i)) / width;
        let (t2, t3) = (t * t, t * t * t);
        let value = [
            2.0 * t3 - 3.0 * t2 + 1.0,
            t3 - 2.0 * t2 + t,
            3.0 * t2 - 2.0 * t3,
            t3 - t2,
        ];
        let slope = [
            6.0 * t2 - 6.0 * t,
            3.0 * t2 - 4.0 * t + 1.0,
            6.0 * t - 6.0 * t2,
            3.0 * t2 - 2.0 * t,
        ];
        // Tangents are the chords over the neighbours, and level at the ends.
        let before = if i == 0 {
            0.0
        } else {
            width / (station(i + 1) - station(i - 1))
        };
        let after = if i + 2 == n {
            0.0
        } else {
            width / (station(i + 2) - station(i))
        };
        let weights = |[p1, m1, p2, m2]: [f64; 4]| {
            [-m1 * before, p1 - m2 * after, p2 + m1 * before, m2 * after]
        };
        (i, weights(value), weights(slope).map(|w| w / width))
    }

    /// Signed distance estimate in mm.
    pub(super) fn distance(&self, p: &Point3<f64>) -> f64 {
        let q = self.local_from_limb * p;
        let (i, along, along_slope) = self.station_weights(q.z);
        let neighbour = |j: usize| &self.sections[(i + j).clamp(1, self.sections.len()) - 1];
        let (mut centre, mut centre_slope) = (Vector2::zeros(), Vector2::zeros());
        for j in 0..4 {
            centre += along[j] * neighbour(j).centre;
            centre_slope += along_slope[j] * neighbour(j).centre;
        }
        let offset = q.coords.xy() - centre;
        let rho = offset.norm();
        let turn = offset.y.atan2(offset.x).rem_euclid(TAU) / TAU * ANGLES as f64;
        let base = turn as usize;
        let (around, around_slope) = catmull_rom(turn - base as f64);
        let (mut radius, mut by_turn, mut by_station) = (0.0, 0.0, 0.0);
        for j in 0..4 {
            let radii = &neighbour(j).radii;
            let (mut value, mut slope) = (0.0, 0.0);
            for a in 0..4 {
                let r = radii[(base + ANGLES + a - 1) % ANGLES];
                value += around[a] * r;
                slope += around_slope[a] * r;
            }
            radius += along[j] * value;
            by_turn += along[j] * slope;
            by_station += along_slope[j] * value;
        }
        let by_arc = by_turn * ANGLES as f64 / TAU / rho.max(0.5 * radius).max(1e-9);
        let drift = if rho > 1e-9 {
            offset.dot(&centre_slope) / rho
        } else {
            0.0
        };
        let steepness = (1.0 + by_arc * by_arc + (by_station + drift).powi(2)).sqrt();
        let mut distance = (rho - radius) / steepness;
        if let End::Capped { blend } = self.first {
            distance = smooth_max(distance, self.sections[0].station - q.z, blend);
        }
        if let (End::Capped { blend }, Some(end)) = (self.last, self.sections.last()) {
            distance = smooth_max(distance, q.z - end.station, blend);
        }
        distance
    }

    /// A box in limb coordinates; infinite along an open end.
    pub(super) fn bounds(&self) -> Bounds {
        let mut bounds: Option<Bounds> = None;
        for section in &self.sections {
            let reach = section.radii.iter().fold(0.0, |a: f64, &b| a.max(b)) * 1.05;
            let local = Point3::new(section.centre.x, section.centre.y, section.station);
            let ball = Bounds::ball(&self.local_from_limb.inverse_transform_point(&local), reach);
            bounds = Some(bounds.map_or(ball, |b| b.join(&ball)));
        }
        let mut bounds = bounds.unwrap_or(Bounds::everything());
        let axis = self.local_from_limb.inverse_transform_vector(&Vector3::z());
        for (end, direction) in [(self.first, -axis), (self.last, axis)] {
            if end == End::Open {
                for i in 0..3 {
                    if direction[i] > 1e-6 {
                        bounds.high[i] = f64::INFINITY;
                    } else if direction[i] < -1e-6 {
                        bounds.low[i] = f64::NEG_INFINITY;
                    }
                }
            }
        }
        bounds
    }
}
