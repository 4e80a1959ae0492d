//! How far a limb must tip so that it rests on two places: the core of T_opt.

/// The paper's τ: both ends count as resting when their heights differ by less, mm.
pub(crate) const TAU_MM: f64 = 0.05;

/// A limb seen from the side: (towards proximal, up) relative to the joint centre, mm.
pub(crate) struct Profile {
    /// Points in front of (distal to) the split.
    pub(crate) distal: Vec<[f64; 2]>,
    /// Points behind (proximal to) the split.
    pub(crate) proximal: Vec<[f64; 2]>,
}

/// A tilt that makes both ends rest.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Tilt {
    /// Rotation about the room's X axis, radians; + lifts the proximal end.
    pub(crate) angle_rad: f64,
    /// Evaluations of the closest points that were needed.
    pub(crate) iterations: u32,
}

/// Where a limb is split into front (distal) and back (proximal), given its points' positions
/// along the axis from the joint: at the joint, or at the middle of the limb when less than a
/// tenth of its length lies on one side of the joint.
pub(crate) fn split_level(along_mm: impl Iterator<Item = f64>) -> f64 {
    let (low, high) = along_mm.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), z| {
        (low.min(z), high.max(z))
    });
    let tenth = 0.1 * (high - low);
    if low < -tenth && high > tenth {
        0.0
    } else {
        0.5 * (low + high)
    }
}

/// Lowest point of a tilted set and its height.
fn lowest(points: &[[f64; 2]], angle_rad: f64) -> ([f64; 2], f64) {
    let (sin, cos) = angle_rad.sin_cos();
    let height = |p: &[f64; 2]| p[0] * sin + p[1] * cos;
    points.iter().fold(([0.0; 2], f64::INFINITY), |best, p| {
        let h = height(p);
        if h < best.1 { (*p, h) } else { best }
    })
}

impl Profile {
    /// Lowest height of the distal and of the proximal half after a tilt.
    pub(crate) fn heights(&self, angle_rad: f64) -> [f64; 2] {
        [&self.distal, &self.proximal].map(|half| lowest(half, angle_rad).1)
    }

    /// The tilt at which both halves reach equally low, within [`TAU_MM`].
    ///
    /// Algorithm 2 of the paper: make the line through the closest points parallel to the table
    /// and look for the closest points again. When a pair of points close to the joint sends a
    /// step beyond [`MAX_TILT_RAD`], or [`MAX_STEPS`] are not enough, the sign change of the height
    /// difference is bisected instead. `None` when no tilt within [`MAX_TILT_RAD`] does it.
    pub(crate) fn resting_tilt(&self) -> Option<Tilt> {
        let mut angle_rad: f64 = 0.0;
        for iterations in 1..=MAX_STEPS {
            let (front, d_front) = lowest(&self.distal, angle_rad);
            let (back, d_back) = lowest(&self.proximal, angle_rad);
            if (d_front - d_back).abs() <= TAU_MM {
                return Some(Tilt {
                    angle_rad,
                    iterations,
                });
            }
            angle_rad = -f64::atan2(back[1] - front[1], back[0] - front[0]);
            if angle_rad.abs() > MAX_TILT_RAD {
                break;
            }
        }
        self.bisected_tilt()
    }

    fn bisected_tilt(&self) -> Option<Tilt> {
        let difference = |angle: f64| {
            let [distal, proximal] = self.heights(angle);
            distal - proximal
        };
        let mut iterations = MAX_STEPS + 1;
        let start = difference(0.0);
        let towards = start.signum(); // lifting the proximal end lowers the distal one
        let (mut low, mut high) = (0.0, 0.0);
        loop {
            high += towards * MAX_TILT_RAD / 30.0;
            iterations += 1;
            if high.abs() > MAX_TILT_RAD {
                return None;
            }
            if difference(high).signum() != start.signum() {
                break;
            }
            low = high;
        }
        loop {
            let middle = 0.5 * (low + high);
            let d = difference(middle);
            iterations += 1;
            if d.abs() <= TAU_MM || middle == low || middle == high {
                return (d.abs() <= TAU_MM).then_some(Tilt {
                    angle_rad: middle,
                    iterations,
                });
            }
            if d.signum() == start.signum() {
                low = middle;
            } else {
                high = middle;
            }
        }
    }
}

const MAX_STEPS: u32 = 30;

/// A limb on a table does not tip by more; 60 degrees.
const MAX_TILT_RAD: f64 = std::f64::consts::FRAC_PI_3;

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn half(range: std::ops::Range<f64>) -> impl Strategy<Value = Vec<[f64; 2]>> {
        prop::collection::vec((range, -80.0..80.0_f64).prop_map(|(y, z)| [y, z]), 1..40)
    }

    proptest! {
        /// The paper's steps and the bisection agree that both halves reach equally low, also
        /// for ragged limbs; both fail together only where the steps stop at 60 degrees.
        #[test]
        fn both_searches_bring_the_limb_to_rest(
            distal in half(-200.0..-60.0),
            proximal in half(60.0..300.0),
        ) {
            let profile = Profile { distal, proximal };
            let bisected = profile.bisected_tilt().unwrap();
            for tilt in [profile.resting_tilt().unwrap(), bisected] {
                let [distal, proximal] = profile.heights(tilt.angle_rad);
                prop_assert!((distal - proximal).abs() <= TAU_MM);
            }
        }
    }

    /// The line through the two lowest points, 5 mm on either side of the joint, is 76 degrees
    /// steep; at 23 degrees the limb rests on its far distal point.
    #[test]
    fn steep_first_steps_end_in_bisection() {
        let profile = Profile {
            distal: vec![[-5.0, 0.0], [-100.0, 5.0]],
            proximal: vec![[5.0, -40.0], [100.0, -20.0]],
        };
        let tilt = profile.resting_tilt().unwrap();
        assert!(tilt.iterations > MAX_STEPS, "{tilt:?}");
        let [distal, proximal] = profile.heights(tilt.angle_rad);
        assert!((distal - proximal).abs() <= TAU_MM, "{distal} {proximal}");
        // −100 sin + 5 cos = 5 sin − 40 cos
        let exact = f64::atan2(45.0, 105.0);
        assert!((tilt.angle_rad - exact).abs() < TAU_MM / 100.0, "{tilt:?}");
    }

    #[test]
    fn a_limb_that_cannot_rest_is_told() {
        let profile = Profile {
            distal: vec![[-1.0, 500.0]],
            proximal: vec![[1.0, 0.0]],
        };
        assert!(profile.resting_tilt().is_none());
    }
}
