//! Tilt at which a limb rests on two places: the core of T_opt.

/// The paper's τ: both ends count as resting when their heights differ by less, mm.
pub(crate) const TAU_MM: f64 = 0.05;

/// Largest tilt of a limb on a table: 60 degrees.
const MAX_TILT_RAD: f64 = std::f64::consts::FRAC_PI_3;

/// A limb seen from the side: (towards proximal, up) relative to the joint centre, mm.
pub(crate) struct Profile {
    /// Points in front of (distal to) the split.
    distal: Vec<[f64; 2]>,
    /// Points behind (proximal to) the split.
    proximal: Vec<[f64; 2]>,
    /// Where distal ends and proximal begins, mm towards proximal.
    pub(crate) split_mm: f64,
}

/// A tilt that makes both ends rest.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Tilt {
    /// Rotation about the room's X axis, radians; + lifts the proximal end.
    pub(crate) angle_rad: f64,
    /// Distance of the two points that rest.
    pub(crate) apart_mm: f64,
    /// Evaluations of the closest points that were needed.
    pub(crate) iterations: u32,
}

impl Profile {
    /// Splits a limb at the joint, or at the middle of its length when less than a tenth of it
    /// lies on one side of the joint.
    pub(crate) fn split(points: impl Iterator<Item = [f64; 2]> + Clone) -> Self {
        let (low, high) = points
            .clone()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), [y, _]| {
                (low.min(y), high.max(y))
            });
        let tenth = 0.1 * (high - low);
        let split_mm = if low < -tenth && high > tenth {
            0.0
        } else {
            0.5 * (low + high)
        };
        let (distal, proximal) = points.partition(|[y, _]| *y < split_mm);
        Self {
            distal,
            proximal,
            split_mm,
        }
    }

    /// Both halves, distal first, lifted by these lengths, mm.
    pub(crate) fn lifted(mut self, [distal_mm, proximal_mm]: [f64; 2]) -> Self {
        let halves = [
            (&mut self.distal, distal_mm),
            (&mut self.proximal, proximal_mm),
        ];
        for (half, lift_mm) in halves {
            half.iter_mut().for_each(|[_, z]| *z += lift_mm);
        }
        self
    }

    /// Lowest height of the distal and of the proximal half after a tilt.
    pub(crate) fn heights(&self, angle_rad: f64) -> [f64; 2] {
        let (sin, cos) = angle_rad.sin_cos();
        [&self.distal, &self.proximal].map(|half| {
            let [y, z] = lowest(half, angle_rad.tan());
            y * sin + z * cos
        })
    }

    /// The tilt at which both halves reach equally low, within [`TAU_MM`].
    ///
    /// Algorithm 2 of the paper: make the line through the closest points parallel to the table
    /// and look for the closest points again. `None` when the limb would tip by more than
    /// [`MAX_TILT_RAD`], or all of it lies on one side of the split.
    ///
    /// The loop ends, and there is only one such tilt, because front and back are split across
    /// the table. With t the tangent of the tilt, F(t) = min over distal (z + t y) − min over
    /// proximal (z + t y) is piecewise linear; measured from the split, its slope −(d + p) is
    /// negative, −d < 0 ≤ p being the y of the closest points. The paper's step is Newton's,
    /// N(t) = t + F(t)/(d + p). As t grows d can only grow and p can only fall (the minima are
    /// concave), so between a tilt t₁ too flat and t₂ = N(t₁) too steep F falls by at most
    /// (d₂ + p₁)(t₂ − t₁), of which (d₁ + p₁)(t₂ − t₁) brought it to 0: the step back is at most
    /// (d₂ − d₁)/(d₂ + p₂) of the step there, and so is any later one into the interval that is
    /// left. No tilt is tried twice, hence no pair of closest points, of which there are fewer
    /// than points.
    pub(crate) fn resting_tilt(&self) -> Option<Tilt> {
        let most = self.distal.len() + self.proximal.len();
        if self.distal.is_empty() || self.proximal.is_empty() {
            return None;
        }
        let mut tan: f64 = 0.0;
        for iterations in 1..=most as u32 {
            let (front, back) = (lowest(&self.distal, tan), lowest(&self.proximal, tan));
            let (rise, run) = (back[1] - front[1], back[0] - front[0]);
            let difference_mm = (rise + tan * run) / tan.hypot(1.0);
            if difference_mm.abs() <= TAU_MM {
                let angle_rad = tan.atan();
                return (angle_rad.abs() <= MAX_TILT_RAD).then_some(Tilt {
                    angle_rad,
                    apart_mm: rise.hypot(run),
                    iterations,
                });
            }
            tan = -rise / run;
        }
        None
    }
}

/// The point of a set that is lowest after a tilt.
fn lowest(points: &[[f64; 2]], tan: f64) -> [f64; 2] {
    let height = |p: &[f64; 2]| p[0] * tan + p[1];
    let first = ([0.0; 2], f64::INFINITY);
    let (point, _) = points.iter().fold(first, |best, p| {
        let h = height(p);
        if h < best.1 { (*p, h) } else { best }
    });
    point
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// The edge of the lower convex hull that crosses the split, by Andrew's monotone chain.
    fn hull_edge(mut points: Vec<[f64; 2]>, split_mm: f64) -> ([f64; 2], [f64; 2]) {
        points.sort_by(|a, b| a.partial_cmp(b).unwrap());
        let mut hull: Vec<[f64; 2]> = Vec::new();
        for p in points {
            while let [.., a, b] = hull[..] {
                let turn = (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]);
                if turn > 0.0 {
                    break;
                }
                hull.pop();
            }
            hull.push(p);
        }
        let back = hull.iter().position(|p| p[0] >= split_mm).unwrap();
        (hull[back - 1], hull[back])
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]

        /// Ragged limbs whose halves reach up to the split, where steps are steepest: the paper's
        /// steps end on the edge of the convex hull over the split, each on a new pair of points.
        #[test]
        fn steps_end_on_the_edge_of_the_hull(
            distal in prop::collection::vec((-200.0..-0.01_f64, -80.0..80.0_f64), 1..40),
            proximal in prop::collection::vec((0.01..300.0_f64, -80.0..80.0_f64), 1..40),
        ) {
            let points: Vec<[f64; 2]> =
                distal.into_iter().chain(proximal).map(|(y, z)| [y, z]).collect();
            let profile = Profile::split(points.iter().copied());
            let most = points.len();
            let (front, back) = hull_edge(points, profile.split_mm);
            let edge = -f64::atan2(back[1] - front[1], back[0] - front[0]);
            match profile.resting_tilt() {
                Some(tilt) => {
                    prop_assert!((tilt.iterations as usize) <= most, "{tilt:?} {most}");
                    let [d, p] = profile.heights(tilt.angle_rad);
                    prop_assert!((d - p).abs() <= TAU_MM + 1e-9);
                    let [d, p] = profile.heights(edge);
                    prop_assert!((d - p).abs() < 1e-9);
                }
                None => prop_assert!(edge.abs() > 0.99 * MAX_TILT_RAD, "{edge}"),
            }
        }
    }

    /// The line through the two lowest points, 5 mm on either side of the joint, is 76 degrees
    /// steep; at 23 degrees the limb rests on its far distal point.
    #[test]
    fn steep_first_steps_come_back() {
        let points = [[-5.0, 0.0], [-100.0, 5.0], [5.0, -40.0], [100.0, -20.0]];
        let profile = Profile::split(points.into_iter());
        let tilt = profile.resting_tilt().unwrap();
        // −100 sin + 5 cos = 5 sin − 40 cos
        let exact = f64::atan2(45.0, 105.0);
        assert!((tilt.angle_rad - exact).abs() < TAU_MM / 100.0, "{tilt:?}");
    }

    #[test]
    fn a_limb_that_cannot_rest_is_reported() {
        let steep = Profile::split([[-1.0, 500.0], [1.0, 0.0]].into_iter());
        assert!(steep.resting_tilt().is_none());
        let upright = Profile::split([[3.0, 500.0], [3.0, 0.0]].into_iter());
        assert!(upright.resting_tilt().is_none());
    }
}
