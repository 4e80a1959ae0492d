//! A body given by star-shaped cross-sections along an axis.

use std::f64::consts::TAU;

use nalgebra::{Isometry3, Point2, Point3, Vector2, Vector3};

use super::sdf::{Bounds, smooth_max};

/// Radii per section; 7.5° apart.
const ANGLES: usize = 48;

/// One cross-section: radii around a centre, counted from the first local axis towards the second.
#[derive(Debug, Clone)]
pub(super) struct Section {
    station: f64,
    centre: Vector2<f64>,
    radii: [f64; ANGLES],
}

impl Section {
    /// Section at `station` with radii at equal steps of angle, joined by a periodic cubic.
    pub(super) fn polar(station: f64, centre: [f64; 2], coarse: &[f64]) -> Self {
        let n = coarse.len();
        let radii = std::array::from_fn(|i| {
            let x = i as f64 * n as f64 / ANGLES as f64;
            let (weights, _) = catmull_rom(x.fract());
            (0..4)
                .map(|j| weights[j] * coarse[(x as usize + n + j - 1) % n])
                .sum()
        });
        Self {
            station,
            centre: centre.into(),
            radii,
        }
    }

    /// Elliptic section.
    pub(super) fn ellipse(station: f64, centre: [f64; 2], semi: [f64; 2]) -> Self {
        let radii = std::array::from_fn(|i| {
            let (sine, cosine) = (i as f64 * TAU / ANGLES as f64).sin_cos();
            (cosine / semi[0]).hypot(sine / semi[1]).recip()
        });
        Self {
            station,
            centre: centre.into(),
            radii,
        }
    }

    /// Polygon grown by `round`; star-shaped around the mean of its corners.
    pub(super) fn polygon(station: f64, corners: &[[f64; 2]], round: f64) -> Self {
        let corners: Vec<Point2<f64>> = corners.iter().map(|&c| c.into()).collect();
        let mut centre = Vector2::zeros();
        for corner in &corners {
            centre += corner.coords / corners.len() as f64;
        }
        let radii = std::array::from_fn(|i| {
            let (sine, cosine) = (i as f64 * TAU / ANGLES as f64).sin_cos();
            let (mut inside, mut outside) = (0.0, 500.0);
            for _ in 0..40 {
                let middle = 0.5 * (inside + outside);
                let p = Point2::from(centre + Vector2::new(cosine, sine) * middle);
                if polygon_distance(&corners, &p) < round {
                    inside = middle;
                } else {
                    outside = middle;
                }
            }
            inside
        });
        Self {
            station,
            centre,
            radii,
        }
    }
}

/// Exact signed distance to a simple polygon.
fn polygon_distance(corners: &[Point2<f64>], p: &Point2<f64>) -> f64 {
    let mut nearest = f64::INFINITY;
    let mut inside = false;
    for (i, b) in corners.iter().enumerate() {
        let a = &corners[(i + corners.len() - 1) % corners.len()];
        let (edge, q) = (b - a, p - a);
        let t = (q.dot(&edge) / edge.norm_squared()).clamp(0.0, 1.0);
        nearest = nearest.min((q - edge * t).norm());
        if (a.y > p.y) != (b.y > p.y) && q.x < edge.x * q.y / edge.y {
            inside = !inside;
        }
    }
    if inside { -nearest } else { nearest }
}

/// Weights of the four neighbours and their derivatives at fraction `t` of a uniform interval.
fn catmull_rom(t: f64) -> ([f64; 4], [f64; 4]) {
    let (t2, t3) = (t * t, t * t * t);
    (
        [
            0.5 * (-t + 2.0 * t2 - t3),
            0.5 * (2.0 - 5.0 * t2 + 3.0 * t3),
            0.5 * (t + 4.0 * t2 - 3.0 * t3),
            0.5 * (t3 - t2),
        ],
        [
            0.5 * (-1.0 + 4.0 * t - 3.0 * t2),
            0.5 * (-10.0 * t + 9.0 * t2),
            0.5 * (1.0 + 8.0 * t - 9.0 * t2),
            0.5 * (3.0 * t2 - 2.0 * t),
        ],
    )
}

/// Where a loft ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum End {
    /// Continues with its last section.
    Open,
    /// Cut square, the edge rounded over so many mm.
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
        // Tangents are the chords over the neighbours; level at the ends.
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

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A loft whose circles grow by `slope` per mm is a cone.
    fn cone(slope: f64) -> Loft {
        let sections = (0..6)
            .map(|n| 20.0 * f64::from(n))
            .map(|s| Section::polar(s, [1.0, -2.0], &[10.0 + slope * s; 12]))
            .collect();
        Loft::new(
            Isometry3::translation(3.0, 0.0, 0.0),
            sections,
            End::Open,
            End::Open,
        )
    }

    proptest! {
        #[test]
        fn a_loft_of_growing_circles_is_a_cone(
            slope in -0.05..0.4_f64, angle in 0.0..TAU, s in 25.0..75.0_f64, offset in -3.0..3.0_f64,
        ) {
            let radius = 10.0 + slope * s;
            let steepness = slope.hypot(1.0);
            // Off the surface along its normal; the loft is moved by -3 in x.
            let (rho, z) = (radius + offset / steepness, s - offset * slope / steepness);
            let p = Point3::new(-2.0 + rho * angle.cos(), -2.0 + rho * angle.sin(), z);
            let distance = cone(slope).distance(&p);
            prop_assert!((distance - offset).abs() < 1e-6, "{distance} for {offset}");
        }

        #[test]
        fn polygon_sections_pass_through_the_grown_edges(t in 0.1..0.9_f64, offset in -2.0..2.0_f64) {
            let corners = [[-20.0, -10.0], [20.0, -10.0], [20.0, 10.0], [-20.0, 10.0]];
            let sections = [0.0, 50.0].map(|s| Section::polygon(s, &corners, 4.0)).to_vec();
            let slab = Loft::new(Isometry3::identity(), sections, End::Open, End::Open);
            let p = Point3::new(-20.0 + 40.0 * t, 14.0 + offset, 25.0);
            let distance = slab.distance(&p);
            prop_assert!((distance - offset).abs() < 0.25, "{distance} for {offset}");
        }
    }

    #[test]
    fn a_capped_end_is_where_its_section_lies() {
        let sections = [0.0, 30.0]
            .map(|s| Section::ellipse(s, [0.0; 2], [12.0, 8.0]))
            .to_vec();
        let end = End::Capped { blend: 4.0 };
        let loft = Loft::new(Isometry3::identity(), sections, end, End::Open);
        assert!((loft.distance(&Point3::new(0.0, 0.0, -5.0)) - 5.0).abs() < 1e-9);
        assert!(loft.distance(&Point3::new(0.0, 0.0, 500.0)) < -7.0);
        assert!((loft.distance(&Point3::new(12.0, 0.0, 15.0))).abs() < 1e-9);
    }
}
