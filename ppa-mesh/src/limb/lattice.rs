//! The lattice of a volume, or of a box of it.

use nalgebra::Vector3;
use ppa_ct::Grid;

/// A box of voxels of a volume. Voxels are counted from the box's first one, x fastest.
pub struct Lattice {
    /// First voxel of the box in the volume.
    pub low: [usize; 3],
    pub size: [usize; 3],
    /// Size of the volume.
    pub whole: [usize; 3],
    pub spacing_mm: [f64; 3],
    /// Volume of a voxel: less than the product of the spacings where the lattice is sheared.
    pub voxel_mm3: f64,
    /// Area of a voxel's face across each axis.
    pub face_mm2: [f64; 3],
    /// Index axis nearest to the patient's z, along which the couch moves.
    pub scan_axis: usize,
}

impl Lattice {
    /// All of a volume.
    pub fn of(grid: &Grid) -> Self {
        let direction = grid.direction();
        let spacing: Vector3<f64> = grid.spacing_mm();
        let edges = [0, 1, 2].map(|axis| direction.column(axis) * spacing[axis]);
        let face = |axis: usize| edges[(axis + 1) % 3].cross(&edges[(axis + 2) % 3]);
        Self {
            low: [0; 3],
            size: grid.size(),
            whole: grid.size(),
            spacing_mm: spacing.into(),
            voxel_mm3: edges[0].dot(&face(0)).abs(),
            face_mm2: [0, 1, 2].map(|axis| face(axis).norm()),
            scan_axis: direction.transpose().column(2).iamax(),
        }
    }

    /// The box of the same volume that reaches `margin` voxels beyond `low..high`, clipped to the
    /// volume.
    pub fn window_around(&self, low: [usize; 3], high: [usize; 3], margin: usize) -> Self {
        let low = low.map(|first| first.saturating_sub(margin));
        Self {
            low,
            size: [0, 1, 2].map(|x| (high[x] + margin).min(self.whole[x]) - low[x]),
            ..*self
        }
    }

    pub fn len(&self) -> usize {
        self.size.iter().product()
    }

    pub fn strides(&self) -> [usize; 3] {
        [1, self.size[0], self.size[0] * self.size[1]]
    }

    pub fn voxel(&self, at: usize) -> [usize; 3] {
        let [nx, ny, _] = self.size;
        let row = at / nx;
        [at - row * nx, row % ny, row / ny]
    }

    /// Row number `row` of the box along x, from values of the whole volume.
    pub fn row_of<'a, T>(&self, row: usize, values: &'a [T]) -> &'a [T] {
        let (j, k) = (row % self.size[1], row / self.size[1]);
        let [nx, ny, _] = self.whole;
        let start = self.low[0] + nx * (self.low[1] + j + ny * (self.low[2] + k));
        &values[start..start + self.size[0]]
    }

    /// The two axes across the scan axis.
    pub fn across(&self) -> [usize; 2] {
        match self.scan_axis {
            0 => [1, 2],
            1 => [0, 2],
            _ => [0, 1],
        }
    }

    /// Whether a voxel is in the first and in the last layer of the volume across an axis.
    pub fn at_walls(&self, voxel: [usize; 3], axis: usize) -> [bool; 2] {
        let place = voxel[axis] + self.low[axis];
        [place == 0, place + 1 == self.whole[axis]]
    }
}
