//! Rays through the centres of pixels: on a lattice of pixels, and in between only where interpolation is not accurate enough.
//!
//! docs/physics.md, "Fast engine", primary.

use rayon::prelude::*;

use crate::transport::tally::Moments;

/// Largest step of a lattice in pixels.
const WIDEST: usize = 4;

/// Error of cubic interpolation halfway between four nodes, as a share of the fourth difference around them, where the image is smooth:
/// twice that of a polynomial of fourth degree.
pub(super) const SMOOTH_ERROR: f64 = 3.0 / 64.0;

/// Upper limit of the same at a kink.
pub(super) const KINK_ERROR: f64 = 3.0 / 8.0;

/// Weights of four nodes halfway between the inner two.
const HALFWAY: [f64; 4] = [-0.0625, 0.5625, 0.5625, -0.0625];

/// Pixels along x and y.
type Size = [usize; 2];

/// Values at the centres of all pixels.
///
/// Neighbours on the widest lattice are at most `most` pixels apart, on each following one half as far, and on the last one pixel. `of`
/// returns the values of the pixels that a lattice adds; it may take them from [`Between`], which interpolates between the nodes of
/// the wider lattice where their fourth differences are below `tolerance`, a share of the value.
pub(super) fn values(
    size: Size,
    most: f64,
    tolerance: impl Fn(Moments) -> f64 + Sync,
    of: impl Fn(&[usize], Option<&Between>) -> Vec<Moments>,
) -> Vec<Moments> {
    let mut values = vec![Moments::default(); size[0] * size[1]];
    let steps = std::iter::successors(Some(WIDEST), |step| (*step > 1).then_some(step / 2));
    let mut wider: Option<Lattice> = None;
    for step in steps.filter(|&step| step == 1 || step as f64 <= most) {
        let lattice = Lattice::new(size, step);
        let pixels = lattice.pixels(wider.as_ref());
        let between = wider.map(|wider| wider.between(&values, &tolerance));
        let found = of(&pixels, between.as_ref());
        for (pixel, value) in pixels.into_iter().zip(found) {
            values[pixel] = value;
        }
        wider = Some(lattice);
    }
    values
}

/// Every `step`-th pixel along both axes.
struct Lattice {
    size: Size,
    step: usize,
    /// Nodes along both axes.
    nodes: Size,
}

impl Lattice {
    fn new(size: Size, step: usize) -> Self {
        Self {
            size,
            step,
            nodes: size.map(|pixels| pixels.div_ceil(step)),
        }
    }

    /// All nodes that are not in a wider lattice.
    fn pixels(&self, wider: Option<&Self>) -> Vec<usize> {
        let along = |axis: usize| (0..self.size[axis]).step_by(self.step);
        let is_known = |[x, y]: [usize; 2]| {
            wider.is_some_and(|wider| x % wider.step == 0 && y % wider.step == 0)
        };
        along(1)
            .flat_map(|y| along(0).map(move |x| [x, y]))
            .filter(|&at| !is_known(at))
            .map(|[x, y]| x + y * self.size[0])
            .collect()
    }

    /// Interpolation between nodes whose fourth differences are below `tolerance`, a share of the value.
    fn between<'a>(
        self,
        values: &'a [Moments],
        tolerance: &(impl Fn(Moments) -> f64 + Sync),
    ) -> Between<'a> {
        let even = (0..self.nodes[0] * self.nodes[1])
            .into_par_iter()
            .map(|node| {
                let at = [node % self.nodes[0], node / self.nodes[0]];
                let value = values[self.pixel(at)];
                let bends = [0, 1].map(|axis| self.fourth_difference(values, at, axis));
                let allowed = tolerance(value) * value.mean_kev;
                bends
                    .into_iter()
                    .all(|bend| bend.is_some_and(|bend| bend.abs() <= allowed))
            })
            .collect();
        Between {
            lattice: self,
            values,
            even,
        }
    }

    fn pixel(&self, at: Size) -> usize {
        self.step * (at[0] + at[1] * self.size[0])
    }

    /// Fourth difference along an axis; `None` next to the rim, where it is unknown.
    fn fourth_difference(&self, values: &[Moments], at: Size, axis: usize) -> Option<f64> {
        if at[axis] < 2 || at[axis] + 2 >= self.nodes[axis] {
            return None;
        }
        let stride = self.step * [1, self.size[0]][axis];
        let pixel = self.pixel(at);
        let both = |steps: usize| {
            values[pixel - steps * stride].mean_kev + values[pixel + steps * stride].mean_kev
        };
        Some(both(2) - 4.0 * both(1) + 6.0 * values[pixel].mean_kev)
    }
}

/// Interpolation from a lattice to pixels halfway between its nodes.
pub(super) struct Between<'a> {
    lattice: Lattice,
    values: &'a [Moments],
    /// Nodes around which interpolation is accurate enough.
    even: Vec<bool>,
}

impl Between<'_> {
    /// The value of a pixel, if all nodes next to it are even and no moment becomes negative.
    pub fn at(&self, pixel: usize) -> Option<Moments> {
        let Lattice { size, step, nodes } = self.lattice;
        let at = [pixel % size[0], pixel / size[0]];
        let lower = at.map(|at| at / step);
        let halfway = at.map(|at| at % step != 0);
        let is_even =
            |x: usize, y: usize| x < nodes[0] && y < nodes[1] && self.even[x + y * nodes[0]];
        let beside = |axis: usize| lower[axis]..=lower[axis] + usize::from(halfway[axis]);
        if !beside(1).all(|y| beside(0).all(|x| is_even(x, y))) {
            return None;
        }
        // Even nodes have two neighbours on every side.
        let weights = |axis: usize| {
            let (first, weights): (usize, &[f64]) = if halfway[axis] {
                (lower[axis] - 1, &HALFWAY)
            } else {
                (lower[axis], &[1.0])
            };
            (first..).zip(weights)
        };
        let terms = weights(1).flat_map(|(y, along_y)| {
            weights(0).map(move |(x, along_x)| ([x, y], along_x * along_y))
        });
        let value: Moments = terms
            .map(|(node, weight)| self.values[self.lattice.pixel(node)].scaled(weight))
            .sum();
        (value.mean_kev >= 0.0 && value.square_kev2 >= 0.0).then_some(value)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::*;

    const SIZE: Size = [150, 90];
    const TOLERANCE: f64 = 1e-3;

    /// Computed values and the number of traced ones, with neighbours at most `most` pixels apart.
    fn found(size: Size, most: f64, image: impl Fn([f64; 2]) -> f64) -> (Vec<Moments>, usize) {
        found_within(size, most, TOLERANCE, image)
    }

    fn found_within(
        size: Size,
        most: f64,
        tolerance: f64,
        image: impl Fn([f64; 2]) -> f64,
    ) -> (Vec<Moments>, usize) {
        let traced = AtomicUsize::new(0);
        let of = |pixels: &[usize], between: Option<&Between>| {
            let value = |&pixel: &usize| {
                between
                    .and_then(|between| between.at(pixel))
                    .unwrap_or_else(|| {
                        traced.fetch_add(1, Ordering::Relaxed);
                        let mean_kev =
                            image([pixel % size[0], pixel / size[0]].map(|at| at as f64));
                        Moments {
                            mean_kev,
                            square_kev2: 2.0 * mean_kev,
                        }
                    })
            };
            pixels.iter().map(value).collect()
        };
        let values = values(size, most, |_| tolerance / SMOOTH_ERROR, of);
        (values, traced.into_inner())
    }

    fn largest_error(values: &[Moments], image: impl Fn([f64; 2]) -> f64) -> f64 {
        let error = |(pixel, value): (usize, &Moments)| {
            let expected = image([pixel % SIZE[0], pixel / SIZE[0]].map(|at| at as f64));
            assert!((value.square_kev2 / value.mean_kev - 2.0).abs() < 1e-12);
            (value.mean_kev / expected - 1.0).abs()
        };
        values.iter().enumerate().map(error).fold(0.0, f64::max)
    }

    /// Waves of 3 % and 16 pixels.
    #[test]
    fn smooth_images_are_interpolated_within_the_tolerance() {
        let image = |[x, y]: [f64; 2]| 5.0 + 0.15 * (0.4 * x).sin() * (0.35 * y).cos() + 0.01 * y;
        let (values, traced) = found(SIZE, 4.0, image);
        assert!(traced < values.len() / 2, "{traced} of {}", values.len());
        let error = largest_error(&values, image);
        assert!(0.0 < error && error < TOLERANCE, "{error}");
    }

    /// A slanted edge and a point between the nodes of the widest lattice.
    #[test]
    fn edges_are_traced() {
        let image = |[x, y]: [f64; 2]| {
            let beyond = if x > 40.3 + 0.3 * y { 3.0 } else { 1.0 };
            let point = (-((x - 110.0).powi(2) + (y - 45.0).powi(2)) / 4.0).exp();
            beyond * (1.0 - 0.3 * point)
        };
        let (values, traced) = found(SIZE, 4.0, image);
        assert!(traced < values.len() / 2, "{traced} of {}", values.len());
        let error = largest_error(&values, image);
        assert!(error < 2.0 * TOLERANCE, "{error}");
    }

    #[test]
    fn every_pixel_of_a_coarse_detector_is_traced() {
        let (values, traced) = found(SIZE, 1.9, |[x, _]| 1.0 + x);
        assert_eq!(traced, values.len());
    }

    #[test]
    fn small_detectors_are_traced_wholly() {
        for size in [[1, 1], [1, 90], [5, 5], [9, 2]] {
            let (values, traced) = found(size, 4.0, |[x, y]| 1.0 + x + 10.0 * y);
            assert_eq!(traced, size[0] * size[1]);
            let last = (size[0] - 1) as f64 + 10.0 * (size[1] - 1) as f64;
            assert_eq!(values[traced - 1].mean_kev, 1.0 + last);
        }
    }

    /// Between two dark nodes of a bright image the cubic is negative.
    #[test]
    fn no_value_becomes_negative() {
        let image = |[x, _]: [f64; 2]| if (x - 78.0).abs() < 5.0 { 1e-6 } else { 1.0 };
        let (values, _) = found_within(SIZE, 4.0, 1e9, image);
        assert!(values.iter().all(|value| value.mean_kev >= 0.0));
    }
}
