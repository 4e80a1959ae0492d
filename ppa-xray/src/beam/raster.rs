//! Cells of the detector plane.

/// Largest number of pixels of a detector: 2²⁸, whose planes take 8 GiB.
pub(crate) const MAX_PIXELS: usize = 1 << 28;

/// A rectangle in the detector plane, divided into equal cells.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Raster {
    pub columns: usize,
    pub rows: usize,
    /// Centre in device x and y.
    pub centre_mm: [f64; 2],
    /// Extent along device x and y.
    pub extent_mm: [f64; 2],
}

impl Raster {
    pub fn cells(&self) -> usize {
        self.columns * self.rows
    }

    pub fn cell_cm2(&self) -> f64 {
        self.extent_mm[0] * self.extent_mm[1] / 100.0 / self.cells() as f64
    }

    /// Row-major cell that contains a point of the plane (device x, y in mm).
    #[inline]
    pub fn cell_at(&self, x_mm: f64, y_mm: f64) -> Option<usize> {
        let column = ((x_mm - self.centre_mm[0]) / self.extent_mm[0] + 0.5) * self.columns as f64;
        let row = ((y_mm - self.centre_mm[1]) / self.extent_mm[1] + 0.5) * self.rows as f64;
        let inside =
            column >= 0.0 && row >= 0.0 && column < self.columns as f64 && row < self.rows as f64;
        inside.then(|| row as usize * self.columns + column as usize)
    }

    /// The point `step` cells from another along x and y. A step from inside the raster is reflected at its edges.
    pub fn moved(&self, from_mm: [f64; 2], step: [f64; 2]) -> [f64; 2] {
        if self.cell_at(from_mm[0], from_mm[1]).is_none() {
            return from_mm;
        }
        [0, 1].map(|axis| {
            let cells = [self.columns, self.rows][axis] as f64;
            let side_mm = self.extent_mm[axis] / cells;
            let low_mm = self.centre_mm[axis] - 0.5 * self.extent_mm[axis];
            let to = ((from_mm[axis] - low_mm) / side_mm + step[axis]).rem_euclid(2.0 * cells);
            low_mm + side_mm * to.min(2.0 * cells - to)
        })
    }

    /// Cells covered by a square around a point of the raster, and their shares; its side is `spot` cells, at most 1.
    ///
    /// The part beyond the raster is folded back at its edge. `None` if the point is outside.
    #[inline]
    pub fn cells_about(&self, x_mm: f64, y_mm: f64, spot: f64) -> Option<[(usize, f64); 4]> {
        self.cell_at(x_mm, y_mm)?;
        let column = ((x_mm - self.centre_mm[0]) / self.extent_mm[0] + 0.5) * self.columns as f64;
        let row = ((y_mm - self.centre_mm[1]) / self.extent_mm[1] + 0.5) * self.rows as f64;
        let along = |at: f64, cells: usize| {
            let end = at + 0.5 * spot;
            let wall = end.floor();
            let beyond = ((end - wall) / spot).min(1.0);
            let last = (cells - 1) as f64;
            [(wall - 1.0, 1.0 - beyond), (wall, beyond)]
                .map(|(cell, share)| (cell.clamp(0.0, last) as usize, share))
        };
        let [(left, a), (right, b)] = along(column, self.columns);
        let [(above, c), (below, d)] = along(row, self.rows);
        let cell = |row: usize, column: usize| row * self.columns + column;
        Some([
            (cell(above, left), a * c),
            (cell(above, right), b * c),
            (cell(below, left), a * d),
            (cell(below, right), b * d),
        ])
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// A step inside the raster is unchanged; one across an edge is folded back, whatever its length.
        #[test]
        fn a_moved_photon_stays_in_the_raster(x in 0.0..6.0_f64, y in 0.0..4.0_f64, step in -30.0..30.0_f64) {
            let raster = Raster { columns: 12, rows: 8, centre_mm: [3.0, 2.0], extent_mm: [6.0, 4.0] };
            let [to_x, to_y] = raster.moved([x, y], [step, 0.0]);
            prop_assert!((to_y - y).abs() < 1e-9);
            let plain = x + 0.5 * step;
            prop_assert!((-1e-9..6.0 + 1e-9).contains(&to_x), "{to_x}");
            let fold = |of: f64| ((of / 6.0 * std::f64::consts::PI).cos() - (to_x / 6.0 * std::f64::consts::PI).cos()).abs();
            prop_assert!(fold(plain) < 1e-9, "{plain} to {to_x}");
            prop_assert_eq!(raster.moved([7.0, y], [step, 0.0]), [7.0, y]);
        }

        /// The shares of a spread photon sum to 1, are balanced about it, and equal the overlap of the squares; next to an edge
        /// they fold back.
        #[test]
        fn a_spread_photon_is_shared_by_overlap(x in 0.0..6.0_f64, y in 0.0..4.0_f64, spot in 0.01..=1.0_f64) {
            let raster = Raster { columns: 6, rows: 4, centre_mm: [3.0, 2.0], extent_mm: [6.0, 4.0] };
            let shares = raster.cells_about(x, y, spot).unwrap();
            let mut found = [0.0; 24];
            for (cell, share) in shares {
                found[cell] += share;
            }
            let overlap = |at: f64, cell: usize, cells: usize| {
                let part = |low: f64, high: f64| (high.min(at + 0.5 * spot) - low.max(at - 0.5 * spot)).max(0.0);
                let low = if cell == 0 { -1.0 } else { cell as f64 };
                let high = if cell + 1 == cells { cells as f64 + 1.0 } else { cell as f64 + 1.0 };
                part(low, high) / spot
            };
            for (cell, found) in found.into_iter().enumerate() {
                let expected = overlap(x, cell % 6, 6) * overlap(y, cell / 6, 4);
                prop_assert!((found - expected).abs() < 1e-9, "cell {cell}: {found}, {expected}");
            }
        }
    }
}
