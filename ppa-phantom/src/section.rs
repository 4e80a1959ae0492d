//! Star-shaped cross-sections.

use std::f64::consts::TAU;

use nalgebra::{Point2, Rotation2, Vector2};

/// Number of radii per section, 7.5° apart.
pub(super) const ANGLES: usize = 48;

/// One cross-section: radii around a centre, counted from the first local axis towards the second.
#[derive(Debug, Clone)]
pub(super) struct Section {
    pub station: f64,
    pub centre: Vector2<f64>,
    pub radii: [f64; ANGLES],
}

impl Section {
    pub(super) fn resized(&self, size: f64) -> Self {
        Self {
            station: self.station * size,
            centre: self.centre * size,
            radii: self.radii.map(|radius| radius * size),
        }
    }

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

    /// The section rotated about the axis, from the first local axis towards the second.
    pub(super) fn turned(&self, angle_rad: f64) -> Self {
        let n = ANGLES as f64;
        let radii = std::array::from_fn(|i| {
            let x = (i as f64 - angle_rad / TAU * n).rem_euclid(n);
            let (weights, _) = catmull_rom(x.fract());
            (0..4)
                .map(|j| weights[j] * self.radii[(x as usize + ANGLES + j - 1) % ANGLES])
                .sum()
        });
        Self {
            station: self.station,
            centre: Rotation2::new(angle_rad) * self.centre,
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
pub(super) fn catmull_rom(t: f64) -> ([f64; 4], [f64; 4]) {
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
