//! Adaptive grid of next-event estimators: nodes of single scatter, denser where the field has curvature.
//!
//! docs/physics.md, "Fast engine", single scatter. A node is inserted where cubic interpolation from its neighbours misses the estimate
//! by more than the tolerance.

use rayon::prelude::*;

use crate::beam::detector::Detector;
use crate::engine::fast_progress::{Monitor, PRIMARY_DONE, SINGLE_DONE};
use crate::engine::first_collisions::ESTIMATES;
use crate::engine::node_grid::NodeGrid;
use crate::engine::primary_signal::PrimarySignal;
use crate::engine::scatter_field::ScatterField;
use crate::engine::single_scatter::{NodeEstimate, PointSampling, Scratch, SingleScatter};
use crate::transport::tally::Moments;

/// Interpolation error, relative to the total signal, above which nodes are refined.
const BEND: f64 = 2e-3;

/// The same relative to the scatter alone: in a bright place the signal hides much, but not in the sums of a category.
const OWN_BEND: f64 = 2e-2;

/// Share of the open field above which fewer collisions suffice: the error permitted by the noise of the exposure is
/// proportional to the square root of the signal.
const DARK: f64 = 0.2;

/// Fewest collisions in bright places, as a share of those in dark ones.
const BRIGHT: f64 = 0.125;

/// Compton and Rayleigh scatter over the detector, and the largest share of a node from a single collision.
///
/// Nodes are `step_mm` apart, or half as far where the node between four neighbours differs from their prediction. A node in the dark
/// samples `collisions` collisions per list on average.
pub(crate) fn single_scatter_field(
    scatter: &SingleScatter,
    detector: &Detector,
    step_mm: f64,
    (seed, collisions): (u64, f64),
    primary: &PrimarySignal,
    monitor: &Monitor,
) -> ([ScatterField; 2], f64) {
    let estimate = |grid: &NodeGrid, level: u64, nodes: &[usize]| -> Vec<NodeEstimate> {
        let middle = 0.5 * (PRIMARY_DONE + SINGLE_DONE);
        let shares = [PRIMARY_DONE..middle, middle..SINGLE_DONE];
        let phase = monitor.phase(shares[level as usize].clone(), nodes.len());
        nodes
            .par_iter()
            .map_init(Scratch::default, |scratch, &node| {
                if phase.is_cancelled() {
                    return NodeEstimate::default();
                }
                phase.advance();
                let at = grid.place(node);
                let share = (DARK / primary.relative_at(at).max(1e-9)).clamp(BRIGHT, 1.0);
                let sampling = PointSampling {
                    collisions: share * collisions,
                    every: (1.0 / share) as usize,
                };
                scatter.at(at, (seed, level << 40 | node as u64), sampling, scratch)
            })
            .collect()
    };
    let mut grid = NodeGrid::new(detector, step_mm);
    let all: Vec<usize> = (0..grid.nodes()).collect();
    let mut nodes = estimate(&grid, 0, &all);
    let mut largest_share = largest(&nodes);
    let close = new_nodes_beside(&grid, &bent_nodes(&grid, &nodes, primary));
    if !close.is_empty() {
        nodes = interpolated(&grid, &nodes);
        grid = grid.refined();
        let closer = estimate(&grid, 1, &close);
        largest_share = largest_share.max(largest(&closer));
        for (&node, closer) in close.iter().zip(closer) {
            nodes[node] = closer;
        }
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

/// Nodes of the refined grid that are new and next to a bent node.
fn new_nodes_beside(grid: &NodeGrid, bent: &[bool]) -> Vec<usize> {
    let fine = grid.refined();
    (0..fine.nodes())
        .filter(|&node| {
            let (i, j) = (node % fine.columns, node / fine.columns);
            let is_old = i % 2 == 0 && j % 2 == 0;
            let near = |at: usize| at / 2..at.div_ceil(2) + 1;
            !is_old && near(j).any(|row| near(i).any(|column| bent[row * grid.columns + column]))
        })
        .collect()
}

fn largest(nodes: &[NodeEstimate]) -> f64 {
    nodes
        .iter()
        .map(|node| node.largest_share)
        .fold(0.0, f64::max)
}

fn mean_kev(node: &NodeEstimate) -> f64 {
    let both = |kinds: &[Moments; 2]| kinds[0].mean_kev + kinds[1].mean_kev;
    node.estimates.iter().map(both).sum::<f64>() / ESTIMATES as f64
}

/// Nodes at which the field bends too much for this grid.
///
/// The middle of four nodes in a row, at -3, -1, 1, 3 steps, is (-1, 9, 9, -1)/16 of them up to an error that falls with
/// the fourth power of the step, or at kinks with the first. The error at half the distance is assumed to be a quarter of it.
/// Next to the rim the four are at -1, 1, 2, 3 steps.
fn bent_nodes(grid: &NodeGrid, nodes: &[NodeEstimate], primary: &PrimarySignal) -> Vec<bool> {
    let values: Vec<f64> = nodes.iter().map(mean_kev).collect();
    let cm2 = primary.detector.pixel_cm2();
    let predicted = |at: usize, count: usize, value: &dyn Fn(usize) -> f64| {
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
            let along_x = predicted(i, grid.columns, &|i| values[j * grid.columns + i]);
            let along_y = predicted(j, grid.rows, &|j| values[j * grid.columns + i]);
            let signal = primary.at(grid.place(node)) / cm2 + values[node];
            let allowed = (BEND * signal).min(OWN_BEND * values[node]);
            [along_x, along_y]
                .into_iter()
                .flatten()
                .any(|predicted| 0.25 * (predicted - values[node]).abs() > allowed)
        })
        .collect()
}

/// Interpolates every estimate between the nodes.
fn interpolated(grid: &NodeGrid, nodes: &[NodeEstimate]) -> Vec<NodeEstimate> {
    let interpolation = grid.to_refined();
    let mut fine = vec![NodeEstimate::default(); grid.refined().nodes()];
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
    use nalgebra::Point2;

    use super::*;

    /// Returns the nodes of a detector of 200 mm, 20 mm apart, that bend under a signal of `primary` open fields.
    fn bent(primary: f64, scatter: impl Fn(Point2<f64>) -> f64) -> Vec<[usize; 2]> {
        let detector = Detector::centred(20, 20, 10.0);
        let kev = |mean_kev: f64| Moments {
            mean_kev,
            square_kev2: mean_kev,
        };
        let moments = vec![kev(primary * detector.pixel_cm2()); detector.pixels()];
        let signal = PrimarySignal {
            detector: &detector,
            moments: &moments,
            open_kev: detector.pixel_cm2(),
        };
        let grid = NodeGrid::new(&detector, 20.0);
        let nodes: Vec<NodeEstimate> = (0..grid.nodes())
            .map(|node| NodeEstimate {
                estimates: [[kev(scatter(grid.place(node))), kev(0.0)]; ESTIMATES],
                largest_share: 0.0,
            })
            .collect();
        let bent = bent_nodes(&grid, &nodes, &signal).into_iter().enumerate();
        bent.filter(|(_, bent)| *bent)
            .map(|(node, _)| [node % grid.columns, node / grid.columns])
            .collect()
    }

    /// The scatter falls within 30 mm of the edge to its constant value elsewhere; only the nodes next to that edge notice.
    #[test]
    fn bends_beside_every_rim_are_seen() {
        for (axis, sign, beside) in [(0, 1.0, 1), (0, -1.0, 9), (1, 1.0, 1), (1, -1.0, 9)] {
            let found = bent(0.0, |at| {
                let from_rim_mm = 100.0 + sign * at[axis];
                1.0 + 2.0 * (1.0 - from_rim_mm / 30.0).max(0.0)
            });
            let expected: Vec<[usize; 2]> = (0..11)
                .map(|along| {
                    let mut node = [along; 2];
                    node[axis] = beside;
                    node
                })
                .collect();
            for node in expected {
                assert!(found.contains(&node), "{node:?} among {found:?}");
            }
            let rim = |node: &[usize; 2]| node[axis].abs_diff(beside) < 4; // reach of a stencil
            assert!(found.iter().all(rim), "{found:?}");
        }
    }

    /// The open field is a hundred times as bright as the scatter. A bend of a tenth of the scatter is hidden from the
    /// image, but not from the sum of the category.
    #[test]
    fn bends_of_scatter_are_seen_in_bright_places() {
        let ridge = |height: f64| bent(1.0, |at| 0.01 * (1.0 + height * f64::from(at.x == 0.0)));
        assert!(ridge(0.1).iter().any(|node| node[0] == 5));
        assert!(ridge(0.05).is_empty());
    }

    /// Four nodes in a row reproduce cubics, at the rim as elsewhere.
    #[test]
    fn cubics_need_no_closer_nodes() {
        let found = bent(0.0, |at| {
            let [x, y] = [at.x / 100.0, at.y / 100.0];
            3.0 + x.powi(3) - 1.5 * x * y * y + y
        });
        assert!(found.is_empty(), "{found:?}");
    }
}
