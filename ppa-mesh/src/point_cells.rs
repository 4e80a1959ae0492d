//! Points sorted into cubes as wide as a search radius, so that few have to be examined to find those within it.

use std::ops::Range;

use nalgebra::Point3;
use rayon::prelude::*;

/// Number of cells per axis that fit into a key; points farther out share the outermost cell, which
/// costs time but loses no pair.
const LAST_CELL: f64 = ((1 << 21) - 3) as f64;

/// Number of cells per parallel task.
const CELLS_PER_TASK: usize = 4096;

/// The finite points of a cloud, ordered by cell.
pub struct PointCells {
    /// Positions, mm.
    places: Vec<[f32; 3]>,
    /// Index of each place in the cloud.
    original: Vec<u32>,
    /// Keys of the cells that contain points, ascending.
    keys: Vec<u64>,
    /// Index of the first place of each cell; one entry more than `keys`.
    starts: Vec<u32>,
    radius_sq: f64,
}

/// Places in the 27 cells around one: in nine rows of three cells along x, the row of the cell itself
/// first, then the four that come after it in the order of places, then the four before it.
pub type Rows = [Range<usize>; 9];

/// Steps along y and z to the rows of [`Rows`].
const STEPS: [[i64; 2]; 9] = [
    [0, 0],
    [1, 0],
    [-1, 1],
    [0, 1],
    [1, 1],
    [-1, 0],
    [1, -1],
    [0, -1],
    [-1, -1],
];

impl PointCells {
    /// Cells of `radius` (mm, positive) for the finite ones of `points` (mm).
    pub fn new(points: &[Point3<f32>], radius: f64) -> Self {
        let finite = |i: &u32| points[*i as usize].coords.iter().all(|c| c.is_finite());
        // Slightly wider, so that rounding cannot put two places within the radius two cells apart.
        let width = radius * (1.0 + 1e-9);
        let low = (0..points.len() as u32)
            .filter(finite)
            .map(|i| points[i as usize])
            .reduce(|a, b| a.inf(&b))
            .unwrap_or_default();
        let mut order: Vec<(u64, u32)> = (0..points.len() as u32)
            .filter(finite)
            .map(|i| {
                let from_low = (points[i as usize].cast::<f64>() - low.cast::<f64>()) / width;
                // From 1 on, so that every cell has neighbours on both sides.
                let [x, y, z] = from_low.map(|c| c.min(LAST_CELL) as u64 + 1).into();
                (z << 42 | y << 21 | x, i)
            })
            .collect();
        order.par_sort_unstable();
        let (mut keys, mut starts) = (Vec::new(), Vec::new());
        for (place, &(key, _)) in order.iter().enumerate() {
            if keys.last() != Some(&key) {
                keys.push(key);
                starts.push(place as u32);
            }
        }
        starts.push(order.len() as u32);
        Self {
            places: order
                .iter()
                .map(|&(_, i)| points[i as usize].into())
                .collect(),
            original: order.into_iter().map(|(_, i)| i).collect(),
            keys,
            starts,
            radius_sq: radius * radius,
        }
    }

    /// Index in the cloud of every place.
    pub fn original(&self) -> &[u32] {
        &self.original
    }

    /// Whether two places are within the radius of each other.
    pub fn near(&self, a: usize, b: usize) -> bool {
        let [p, q] = [a, b].map(|at| self.places[at].map(f64::from));
        let squares = [0, 1, 2].map(|axis| (p[axis] - q[axis]) * (p[axis] - q[axis]));
        squares[0] + squares[1] + squares[2] <= self.radius_sq
    }

    /// Applies `of_place` to every place and its neighbourhood and returns the results in order.
    pub fn map<T: Send>(&self, of_place: impl Fn(usize, &Rows) -> T + Sync) -> Vec<T> {
        let tasks = 0..self.keys.len().div_ceil(CELLS_PER_TASK);
        let tasks = tasks.into_par_iter().flat_map_iter(|task| {
            let first = task * CELLS_PER_TASK;
            let cells = first..(first + CELLS_PER_TASK).min(self.keys.len());
            let mut found = Vec::new();
            self.sweep(cells, |places, rows| {
                found.extend(places.map(|place| of_place(place, rows)));
            });
            found
        });
        tasks.collect()
    }

    /// Calls `visit` with the places of every cell and the rows around it.
    pub fn for_each(&self, visit: impl FnMut(Range<usize>, &Rows)) {
        self.sweep(0..self.keys.len(), visit);
    }

    /// Visits cells in the order of their keys. The rows around them come in the same order, so the ends
    /// of each row only advance.
    fn sweep(&self, cells: Range<usize>, mut visit: impl FnMut(Range<usize>, &Rows)) {
        let Some(&key) = self.keys.get(cells.start) else {
            return;
        };
        let first_of =
            |key: u64, [y, z]: [i64; 2]| key.wrapping_add_signed((z << 42) + (y << 21) - 1);
        let mut ends = STEPS.map(|step| {
            let begin = self.keys.partition_point(|&k| k < first_of(key, step));
            [begin; 2]
        });
        for cell in cells {
            let key = self.keys[cell];
            let rows = std::array::from_fn(|row| {
                let first = first_of(key, STEPS[row]);
                let [begin, end] = &mut ends[row];
                while self.keys.get(*begin).is_some_and(|&k| k < first) {
                    *begin += 1;
                }
                *end = (*end).max(*begin);
                while self.keys.get(*end).is_some_and(|&k| k <= first + 2) {
                    *end += 1;
                }
                self.starts[*begin] as usize..self.starts[*end] as usize
            });
            visit(
                self.starts[cell] as usize..self.starts[cell + 1] as usize,
                &rows,
            );
        }
    }
}
