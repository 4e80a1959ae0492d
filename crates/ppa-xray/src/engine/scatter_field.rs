//! Scatter over the whole detector: estimates at nodes, close together where the field bends.

use nalgebra::{Point2, Point3};
use rayon::prelude::*;

use crate::beam::projection::Detector;
use crate::engine::first_collisions::ESTIMATES;
use crate::engine::node_grid::NodeGrid;
use crate::engine::single_scatter::{Scratch, Seen, SingleScatter};
use crate::transport::tally::Moments;
use crate::transport::tracking::Transport;

/// How often the distance of the nodes may be halved.
const HALVINGS: u32 = 1;

/// Error of the interpolation, relative to the whole signal, beyond which nodes are set closer.
const BEND: f64 = 2e-3;

/// The same relative to the scatter alone: in a bright place the signal hides much, but sums of a category do not.
const OWN_BEND: f64 = 2e-2;

/// Share of the open field from which on fewer collisions will do: the error that the noise of the exposure allows is
/// proportional to the root of the signal.
const DARK: f64 = 0.2;

/// Fewest collisions in bright places, as a share of those in dark ones.
const BRIGHT: f64 = 0.125;

/// Steps along the longer side of the detector at which it is looked at what noise hides.
const TOLERANCES: f64 = 15.0;

/// Scatter in the dark, relative to the open field, more or less.
const LEAST_SCATTER: f64 = 0.01;

/// Independent estimates of one category at the nodes of a grid, energy per cm² and history.
#[derive(Debug)]
pub(crate) struct ScatterField {
    pub grid: NodeGrid,
    /// Estimate by estimate.
    pub estimates: Vec<Vec<Moments>>,
}

/// Energy of one category in every pixel, per history.
pub(crate) struct PixelScatter {
    pub moments: Vec<Moments>,
    /// Squared standard error of the mean energy, keV².
    pub variance_kev2: Vec<f64>,
    /// Energy on the whole detector and its standard error, keV.
    pub sum_kev: (f64, f64),
}

impl ScatterField {
    /// Interpolates to the pixels.
    pub fn on_pixels(&self, detector: &Detector) -> PixelScatter {
        let interpolation = self.grid.to_pixels(detector);
        let cm2 = detector.pixel_cm2();
        let count = self.estimates.len() as f64;
        let nodes = self.grid.nodes();
        let mean = |of: fn(&Moments) -> f64| -> Vec<f64> {
            (0..nodes)
                .map(|node| self.estimates.iter().map(|e| of(&e[node])).sum::<f64>() / count)
                .collect()
        };
        let (energy, square) = (mean(|m| m.mean_kev), mean(|m| m.square_kev2));
        let shares = interpolation.shares();
        let sums: Vec<f64> = self
            .estimates
            .iter()
            .map(|estimate| {
                let shared = estimate.iter().zip(&shares);
                shared.map(|(m, share)| m.mean_kev * share * cm2).sum()
            })
            .collect();
        let sum = sums.iter().sum::<f64>() / count;
        let spread: f64 = sums.iter().map(|s| (s - sum).powi(2)).sum();
        let squares = interpolation.values(&square);
        PixelScatter {
            moments: interpolation
                .values(&energy)
                .into_iter()
                .zip(squares)
                .map(|(mean_kev, square_kev2)| {
                    // Beside nothing the cubics may swing below nothing.
                    let is_light = mean_kev > 0.0 && square_kev2 > 0.0;
                    let moments = Moments {
                        mean_kev,
                        square_kev2,
                    };
                    moments.scaled(if is_light { cm2 } else { 0.0 })
                })
                .collect(),
            variance_kev2: self.covariance_kev2(self, detector),
            sum_kev: (sum, (spread / (count * (count - 1.0))).sqrt()),
        }
    }

    /// Covariance of the errors of the mean energies of two fields on one grid in every pixel, keV²; of a field with
    /// itself their variance.
    pub fn covariance_kev2(&self, other: &Self, detector: &Detector) -> Vec<f64> {
        let count = self.estimates.len() as f64;
        let (these, those) = (self.deviations(), other.deviations());
        let covariance: Vec<f64> = (0..self.grid.refined().nodes())
            .map(|node| {
                let pairs = these.iter().zip(&those);
                let products = pairs.map(|(a, b)| a[node] * b[node]);
                products.sum::<f64>() / (count * (count - 1.0))
            })
            .collect();
        let cm4 = detector.pixel_cm2() * detector.pixel_cm2();
        let pixels = self.grid.refined().to_pixels_linear(detector);
        let covariance = pixels.values(&covariance).into_iter();
        covariance.map(|per_cm4| per_cm4 * cm4).collect()
    }

    /// What the estimates differ by from their mean.
    ///
    /// Neighbouring nodes share part of their errors, so the estimates are interpolated before they are compared; half
    /// way between the nodes is close enough.
    fn deviations(&self) -> Vec<Vec<f64>> {
        let between = self.grid.to_refined();
        let energy = |moments: &Vec<Moments>| -> Vec<f64> {
            let energy: Vec<f64> = moments.iter().map(|m| m.mean_kev).collect();
            between.values(&energy)
        };
        let mut fine: Vec<Vec<f64>> = self.estimates.iter().map(energy).collect();
        for node in 0..self.grid.refined().nodes() {
            let sum: f64 = fine.iter().map(|values| values[node]).sum();
            let mean = sum / fine.len() as f64;
            for values in &mut fine {
                values[node] -= mean;
            }
        }
        fine
    }
}

/// Compton and Rayleigh scatter over the detector, and the largest share of a node that a single collision added.
///
/// `signal` is the primary at a pixel relative to the open field. Nodes `step_mm` apart, and closer where four
/// neighbours at twice the distance do not foretell the one between them.
pub(crate) fn single_scatter_field(
    scatter: &SingleScatter,
    detector: &Detector,
    step_mm: f64,
    (seed, collisions): (u64, f64),
    primary: &PrimarySignal,
) -> ([ScatterField; 2], f64) {
    let mut grid = NodeGrid::new(detector, step_mm);
    let mut level = 0_u64;
    let see = |grid: &NodeGrid, level: u64, nodes: &[usize]| -> Vec<Seen> {
        nodes
            .par_iter()
            .map_init(Scratch::default, |scratch, &node| {
                let at = grid.place(node);
                let share = (DARK / primary.relative_at(at).max(1e-9)).clamp(BRIGHT, 1.0);
                let every = (1.0 / share) as usize;
                let choices = (share * collisions, every);
                scatter.at(at, (seed, level << 40 | node as u64), choices, scratch)
            })
            .collect()
    };
    let all: Vec<usize> = (0..grid.nodes()).collect();
    let mut nodes = see(&grid, level, &all);
    let mut largest_share = largest(&nodes);
    for _ in 0..HALVINGS {
        let bent = bent_nodes(&grid, &nodes, primary);
        let fine = grid.refined();
        let close: Vec<usize> = (0..fine.nodes())
            .filter(|&node| {
                // New nodes beside a bent one; old nodes keep what they have.
                let (i, j) = (node % fine.columns, node / fine.columns);
                let is_old = i % 2 == 0 && j % 2 == 0;
                let near = |at: usize| at / 2..at.div_ceil(2) + 1;
                !is_old
                    && near(j).any(|row| near(i).any(|column| bent[row * grid.columns + column]))
            })
            .collect();
        if close.is_empty() {
            break;
        }
        level += 1;
        let mut between = interpolated(&grid, &nodes);
        let seen = see(&fine, level, &close);
        largest_share = largest_share.max(largest(&seen));
        for (&node, seen) in close.iter().zip(seen) {
            between[node] = seen;
        }
        (grid, nodes) = (fine, between);
    }
    let field = |kind: usize| ScatterField {
        grid,
        estimates: (0..ESTIMATES)
            .map(|estimate| {
                nodes
                    .iter()
                    .map(|node| node.estimates[estimate][kind])
                    .collect()
            })
            .collect(),
    };
    ([field(0), field(1)], largest_share)
}

/// The primary image, to compare scatter with.
pub(crate) struct PrimarySignal<'a> {
    pub detector: &'a Detector,
    pub moments: &'a [Moments],
    /// Energy of a pixel in the open field, keV per history.
    pub open_kev: f64,
}

impl PrimarySignal<'_> {
    /// Energy in the nearest pixel, keV per history.
    fn at(&self, at: Point2<f64>) -> f64 {
        let low = self.detector.field().low_mm;
        let count = [self.detector.columns, self.detector.rows];
        let [column, row] = [0, 1].map(|axis| {
            let pixel = (at[axis] - low[axis]) / self.detector.pixel_mm;
            (pixel.max(0.0) as usize).min(count[axis] as usize - 1)
        });
        self.moments[row * self.detector.columns as usize + column].mean_kev
    }

    /// Points of the detector plane, and the errors of scatter there that the noise of an exposure hides, relative to each
    /// other: the roots of the signal.
    pub fn tolerances(&self, transport: &Transport) -> Vec<(Point3<f64>, f64)> {
        let [width, height] = self.detector.field().size_mm();
        let grid = NodeGrid::new(self.detector, width.max(height) / TOLERANCES);
        (0..grid.nodes())
            .map(|node| grid.place(node))
            .map(|at| {
                let target = Point3::new(at.x, at.y, transport.projection.source_detector_mm);
                (target, (self.relative_at(at) + LEAST_SCATTER).sqrt())
            })
            .collect()
    }

    fn relative_at(&self, at: Point2<f64>) -> f64 {
        self.at(at) / self.open_kev
    }
}

fn largest(nodes: &[Seen]) -> f64 {
    nodes
        .iter()
        .map(|node| node.largest_share)
        .fold(0.0, f64::max)
}

fn mean_kev(node: &Seen) -> f64 {
    let both = |kinds: &[Moments; 2]| kinds[0].mean_kev + kinds[1].mean_kev;
    node.estimates.iter().map(both).sum::<f64>() / ESTIMATES as f64
}

/// Nodes where the field bends too much for this grid.
///
/// The middle of four nodes in a row, at -3, -1, 1, 3 steps, is (-1, 9, 9, -1)/16 of them up to an error that falls with
/// the fourth power of the step; at kinks with the first. A quarter of it is what half the distance is taken to leave.
/// Beside the rim the four are at -1, 1, 2, 3 steps.
fn bent_nodes(grid: &NodeGrid, nodes: &[Seen], primary: &PrimarySignal) -> Vec<bool> {
    let values: Vec<f64> = nodes.iter().map(mean_kev).collect();
    let cm2 = primary.detector.pixel_cm2();
    let foretold = |at: usize, count: usize, value: &dyn Fn(usize) -> f64| {
        let beside_rim = |from: usize, steps: [usize; 3]| {
            let [near, far, farther] = steps.map(value);
            0.25 * (value(from) + farther) + 1.5 * near - far
        };
        if at >= 3 && at + 3 < count {
            let [near, far] = [1, 3].map(|step| value(at - step) + value(at + step));
            Some((9.0 * near - far) / 16.0)
        } else if at >= 1 && at + 3 < count {
            Some(beside_rim(at - 1, [at + 1, at + 2, at + 3]))
        } else if at >= 3 && at + 1 < count {
            Some(beside_rim(at + 1, [at - 1, at - 2, at - 3]))
        } else {
            None
        }
    };
    (0..grid.nodes())
        .map(|node| {
            let (i, j) = (node % grid.columns, node / grid.columns);
            let along_x = foretold(i, grid.columns, &|i| values[j * grid.columns + i]);
            let along_y = foretold(j, grid.rows, &|j| values[j * grid.columns + i]);
            let signal = primary.at(grid.place(node)) / cm2 + values[node];
            let allowed = (BEND * signal).min(OWN_BEND * values[node]);
            [along_x, along_y]
                .into_iter()
                .flatten()
                .any(|foretold| 0.25 * (foretold - values[node]).abs() > allowed)
        })
        .collect()
}

/// Every estimate between the nodes.
fn interpolated(grid: &NodeGrid, nodes: &[Seen]) -> Vec<Seen> {
    let interpolation = grid.to_refined();
    let mut fine = vec![Seen::default(); grid.refined().nodes()];
    for estimate in 0..ESTIMATES {
        for kind in 0..2 {
            let plane = |of: fn(&Moments) -> f64| -> Vec<f64> {
                let values: Vec<f64> = nodes
                    .iter()
                    .map(|node| of(&node.estimates[estimate][kind]))
                    .collect();
                interpolation.values(&values)
            };
            let (mean, square) = (plane(|m| m.mean_kev), plane(|m| m.square_kev2));
            for (node, (mean_kev, square_kev2)) in fine.iter_mut().zip(mean.into_iter().zip(square))
            {
                node.estimates[estimate][kind] = Moments {
                    mean_kev,
                    square_kev2,
                };
            }
        }
    }
    fine
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::philox::Philox;

    fn field(grid: NodeGrid, energy: impl Fn(usize, usize) -> f64) -> ScatterField {
        let moments = |mean_kev| Moments {
            mean_kev,
            square_kev2: 40.0 * mean_kev,
        };
        let nodes = 0..grid.nodes();
        let estimate = |list| {
            nodes
                .clone()
                .map(|node| moments(energy(list, node)))
                .collect()
        };
        ScatterField {
            grid,
            estimates: (0..ESTIMATES).map(estimate).collect(),
        }
    }

    /// Var(a + b) = Var(a) + Var(b) + 2 Cov(a, b) in every pixel, whatever the estimates of a and b have in common.
    #[test]
    fn errors_of_a_sum_are_those_of_its_parts_and_what_they_share() {
        let detector = Detector::centred(23, 17, 4.0);
        let grid = NodeGrid::new(&detector, 20.0);
        let draw = |stream: u32, list: usize, node: usize| {
            Philox::new(8, stream, (list * 1_000 + node) as u64).unit()
        };
        let a = |list, node| 1.0 + draw(0, list, node);
        let b = |list, node| 2.0 + draw(1, list, node) - 0.7 * draw(0, list, node);
        let sum = field(grid, |list, node| a(list, node) + b(list, node));
        let (a, b) = (field(grid, a), field(grid, b));
        let of = |x: &ScatterField, y: &ScatterField| x.covariance_kev2(y, &detector);
        let parts = of(&a, &a).into_iter().zip(of(&b, &b)).zip(of(&a, &b));
        let mut shared = 0.0;
        for (((a, b), both), sum) in parts.zip(of(&sum, &sum)) {
            assert!((a + b + 2.0 * both - sum).abs() < 1e-12 * sum);
            shared += both;
        }
        // −0.7/12 and the errors of 16 estimates: far below 0.
        assert!(shared < 0.0);
    }
}
