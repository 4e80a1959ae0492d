//! Regular grid of nodes on the detector plane with cubic interpolation, exact for polynomials of degree three.
//!
//! Keys, IEEE Trans. Acoust. Speech Signal Process. 29 (1981) 1153; docs/physics.md, "Fast engine", between the points.

use nalgebra::Point2;

use crate::beam::detector::Detector;

/// Equally spaced nodes over the entire detector, its edges included.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct NodeGrid {
    pub columns: usize,
    pub rows: usize,
    low_mm: [f64; 2],
    step_mm: [f64; 2],
}

impl NodeGrid {
    /// The grid with the fewest nodes whose neighbours are at most `step_mm` apart.
    pub fn new(detector: &Detector, step_mm: f64) -> Self {
        let field = detector.field();
        let size = field.size_mm();
        let count = size.map(|size| (size / step_mm).ceil().max(1.0) as usize + 1);
        Self {
            columns: count[0],
            rows: count[1],
            low_mm: field.low_mm,
            step_mm: [0, 1].map(|axis| size[axis] / (count[axis] - 1) as f64),
        }
    }

    /// A grid with nodes at the pixel centres of a detector.
    pub fn of_pixels(detector: &Detector) -> Self {
        let low_mm = detector.field().low_mm;
        Self {
            columns: detector.columns as usize,
            rows: detector.rows as usize,
            low_mm: low_mm.map(|low| low + 0.5 * detector.pixel_mm),
            step_mm: [detector.pixel_mm; 2],
        }
    }

    /// The grid with an additional node between every two neighbours.
    pub fn refined(&self) -> Self {
        Self {
            columns: 2 * self.columns - 1,
            rows: 2 * self.rows - 1,
            low_mm: self.low_mm,
            step_mm: self.step_mm.map(|step| 0.5 * step),
        }
    }

    pub fn nodes(&self) -> usize {
        self.columns * self.rows
    }

    pub fn place(&self, node: usize) -> Point2<f64> {
        let at = [node % self.columns, node / self.columns];
        Point2::from([0, 1].map(|axis| self.low_mm[axis] + at[axis] as f64 * self.step_mm[axis]))
    }

    /// Cubic interpolation to the pixels of a detector.
    pub fn to_pixels(self, detector: &Detector) -> Interpolation {
        self.to_pixels_through(CUBIC, detector)
    }

    /// Linear interpolation to the pixels of a detector, which preserves positive values.
    pub fn to_pixels_linear(self, detector: &Detector) -> Interpolation {
        self.to_pixels_through(LINEAR, detector)
    }

    fn to_pixels_through(self, neighbours: usize, detector: &Detector) -> Interpolation {
        let low_mm = detector.field().low_mm;
        let axis = |axis: usize, nodes: usize, pixels: u32| {
            (0..pixels)
                .map(|pixel| {
                    let at_mm = low_mm[axis] + (f64::from(pixel) + 0.5) * detector.pixel_mm;
                    let at = (at_mm - self.low_mm[axis]) / self.step_mm[axis];
                    Stencil::at(at, nodes, neighbours)
                })
                .collect()
        };
        Interpolation {
            columns: axis(0, self.columns, detector.columns),
            rows: axis(1, self.rows, detector.rows),
            nodes: [self.columns, self.rows],
        }
    }

    /// Cubic interpolation to the nodes of [`NodeGrid::refined`].
    pub fn to_refined(self) -> Interpolation {
        let axis = |nodes: usize| {
            (0..2 * nodes - 1)
                .map(|node| Stencil::at(0.5 * node as f64, nodes, CUBIC))
                .collect()
        };
        Interpolation {
            columns: axis(self.columns),
            rows: axis(self.rows),
            nodes: [self.columns, self.rows],
        }
    }
}

/// Number of neighbours along an axis; polynomials of third and of first degree are reproduced exactly.
const CUBIC: usize = 4;
const LINEAR: usize = 2;

/// Interpolation along both axes.
#[derive(Debug)]
pub(crate) struct Interpolation {
    columns: Vec<Stencil>,
    rows: Vec<Stencil>,
    /// Nodes along each axis, including those without a point nearby.
    nodes: [usize; 2],
}

/// Neighbouring nodes and their weights.
#[derive(Debug, Clone, Copy)]
struct Stencil {
    first: usize,
    length: usize,
    weights: [f64; CUBIC],
}

impl Stencil {
    /// Lagrange's polynomial through up to `neighbours` nodes around `at`; at the rim, through the outermost ones.
    fn at(at: f64, nodes: usize, neighbours: usize) -> Self {
        let length = nodes.min(neighbours);
        let first = (at.floor() - (neighbours / 2 - 1) as f64).max(0.0) as usize;
        let first = first.min(nodes - length);
        let mut weights = [0.0; CUBIC];
        for (i, weight) in weights.iter_mut().enumerate().take(length) {
            *weight = (0..length)
                .filter(|&j| j != i)
                .map(|j| (at - (first + j) as f64) / (i as f64 - j as f64))
                .product();
        }
        Self {
            first,
            length,
            weights,
        }
    }

    fn apply(&self, value: impl Fn(usize) -> f64) -> f64 {
        (0..self.length)
            .map(|i| self.weights[i] * value(self.first + i))
            .sum()
    }
}

impl Interpolation {
    /// Contribution of each node to the sum of all interpolated values.
    pub fn shares(&self) -> Vec<f64> {
        let along = |stencils: &[Stencil], nodes: usize| {
            let mut sums = vec![0.0; nodes];
            for stencil in stencils {
                for i in 0..stencil.length {
                    sums[stencil.first + i] += stencil.weights[i];
                }
            }
            sums
        };
        let columns = along(&self.columns, self.nodes[0]);
        let rows = along(&self.rows, self.nodes[1]);
        rows.iter()
            .flat_map(|row| columns.iter().map(move |column| row * column))
            .collect()
    }

    /// Interpolated values.
    pub fn values(&self, nodes: &[f64]) -> Vec<f64> {
        let across: Vec<f64> = nodes
            .chunks_exact(self.nodes[0])
            .flat_map(|row| {
                self.columns
                    .iter()
                    .map(move |stencil| stencil.apply(|node| row[node]))
            })
            .collect();
        let width = self.columns.len();
        self.rows
            .iter()
            .flat_map(|stencil| {
                let across = &across;
                (0..width).map(move |column| stencil.apply(|node| across[node * width + column]))
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn detector() -> Detector {
        Detector::centred(37, 22, 3.0)
    }

    fn cubic(at: Point2<f64>) -> f64 {
        1.0 + 0.1 * at.x - 0.02 * at.x * at.y + 1e-3 * at.y.powi(3) - 2e-4 * at.x.powi(2) * at.y
    }

    #[test]
    fn cubic_polynomials_are_met_exactly_up_to_the_rim() {
        let detector = detector();
        let grid = NodeGrid::new(&detector, 17.0);
        let nodes: Vec<f64> = (0..grid.nodes())
            .map(|node| cubic(grid.place(node)))
            .collect();
        for (pixel, value) in grid.to_pixels(&detector).values(&nodes).iter().enumerate() {
            let at = detector.pixel_centre_mm(pixel);
            assert!((value - cubic(at)).abs() < 1e-9, "{value} at {at}");
        }
        let fine = grid.refined();
        for (node, value) in grid.to_refined().values(&nodes).iter().enumerate() {
            assert!((value - cubic(fine.place(node))).abs() < 1e-9);
        }
    }

    /// Also if the nodes are so close that no pixel is near the outermost ones.
    #[test]
    fn shares_sum_up_what_the_pixels_get() {
        let detector = detector();
        for step_mm in [17.0, 0.5] {
            let grid = NodeGrid::new(&detector, step_mm);
            let nodes: Vec<f64> = (0..grid.nodes())
                .map(|node| cubic(grid.place(node)))
                .collect();
            let interpolation = grid.to_pixels(&detector);
            let sum: f64 = interpolation.values(&nodes).iter().sum();
            let shares = interpolation.shares();
            let shared: f64 = shares.iter().zip(&nodes).map(|(a, b)| a * b).sum();
            assert!(
                (sum / shared - 1.0).abs() < 1e-9,
                "{step_mm} mm: {sum} {shared}"
            );
        }
    }

    /// A detector of one pixel, or smaller than a step, has two nodes per side.
    #[test]
    fn the_smallest_detector_has_four_nodes() {
        let one = Detector::centred(1, 1, 0.5);
        let grid = NodeGrid::new(&one, 20.0);
        assert_eq!(grid.nodes(), 4);
        assert_eq!(grid.to_pixels(&one).values(&[1.0, 2.0, 3.0, 4.0]), [2.5]);
    }
}
