//! From coarse cells to pixels by smooth interpolation that keeps the sum.

use crate::beam::projection::Detector;
use crate::transport::tally::Raster;

/// Quadratic B-spline interpolation from a coarse raster to the pixels of the same rectangle.
///
/// Weights are non-negative and mirrored at the edges. Each cell's value is spread by weights that sum to one
/// over the pixels, so what was counted is neither lost nor invented.
#[derive(Debug)]
pub(crate) struct Upsampling {
    columns: Vec<Stencil>,
    rows: Vec<Stencil>,
    coarse_columns: usize,
}

/// Three neighbouring cells and their share in one pixel.
#[derive(Debug, Clone, Copy)]
struct Stencil {
    cells: [usize; 3],
    weights: [f64; 3],
}

impl Upsampling {
    pub fn new(coarse: &Raster, detector: &Detector) -> Self {
        Self {
            columns: stencils(coarse.columns, detector.columns as usize),
            rows: stencils(coarse.rows, detector.rows as usize),
            coarse_columns: coarse.columns,
        }
    }

    /// Content of every pixel, row-major, from the content of every cell.
    pub fn densities(&self, cells: &[f64]) -> Vec<f64> {
        self.apply(cells, |weight| weight)
    }

    /// Variance of every pixel from the variances of independent cells.
    pub fn variances(&self, cells: &[f64]) -> Vec<f64> {
        self.apply(cells, |weight| weight * weight)
    }

    fn apply(&self, cells: &[f64], power: impl Fn(f64) -> f64) -> Vec<f64> {
        let mut pixels = Vec::with_capacity(self.rows.len() * self.columns.len());
        for row in &self.rows {
            for column in &self.columns {
                let mut sum = 0.0;
                for (j, wj) in row.merged() {
                    for (i, wi) in column.merged() {
                        sum += power(wi * wj) * cells[j * self.coarse_columns + i];
                    }
                }
                pixels.push(sum);
            }
        }
        pixels
    }
}

impl Stencil {
    /// Mirrored cells counted once, so that squared weights are right too.
    fn merged(self) -> impl Iterator<Item = (usize, f64)> {
        (0..3).filter_map(move |n| {
            let first = self.cells[..n].iter().all(|&c| c != self.cells[n]);
            let weight = (n..3)
                .filter(|&m| self.cells[m] == self.cells[n])
                .map(|m| self.weights[m])
                .sum();
            first.then_some((self.cells[n], weight))
        })
    }
}

fn stencils(coarse: usize, fine: usize) -> Vec<Stencil> {
    let mut stencils: Vec<Stencil> = (0..fine)
        .map(|pixel| {
            let at = (pixel as f64 + 0.5) * coarse as f64 / fine as f64;
            let cell = (at as usize).min(coarse - 1);
            let f = at - cell as f64 - 0.5;
            Stencil {
                cells: [cell.saturating_sub(1), cell, (cell + 1).min(coarse - 1)],
                weights: [
                    0.5 * (0.5 - f) * (0.5 - f),
                    0.75 - f * f,
                    0.5 * (0.5 + f) * (0.5 + f),
                ],
            }
        })
        .collect();
    let mut spread = vec![0.0; coarse];
    for stencil in &stencils {
        for (&cell, weight) in stencil.cells.iter().zip(stencil.weights) {
            spread[cell] += weight;
        }
    }
    for stencil in &mut stencils {
        for (&cell, weight) in stencil.cells.iter().zip(&mut stencil.weights) {
            *weight /= spread[cell];
        }
    }
    stencils
}

#[cfg(test)]
mod tests {
    use super::*;

    fn upsampling(coarse: [usize; 2], fine: [u32; 2]) -> Upsampling {
        let detector = Detector::centred(fine[0], fine[1], 1.0);
        let raster = Raster {
            columns: coarse[0],
            rows: coarse[1],
            ..detector.raster()
        };
        Upsampling::new(&raster, &detector)
    }

    #[test]
    fn the_sum_is_kept_also_where_cells_and_pixels_do_not_match() {
        let cells: Vec<f64> = (0..35).map(|i| f64::from(i * i % 13)).collect();
        let pixels = upsampling([7, 5], [30, 32]).densities(&cells);
        let (before, after) = (cells.iter().sum::<f64>(), pixels.iter().sum::<f64>());
        assert!((before - after).abs() < 1e-9 * before);
    }

    #[test]
    fn a_straight_slope_stays_straight_inside() {
        let cells: Vec<f64> = (0..8).map(|i| 20.0 + 10.0 * f64::from(i)).collect();
        let pixels = upsampling([8, 1], [80, 1]).densities(&cells);
        for (i, value) in pixels.iter().enumerate().take(70).skip(10) {
            let expected = 2.0 + 0.1 * (i as f64 + 0.5 - 5.0);
            assert!((value - expected).abs() < 1e-9, "{i}: {value} {expected}");
        }
    }

    #[test]
    fn a_cell_spreads_around_its_own_place() {
        let mut cells = vec![0.0; 12];
        cells[4 + 2] = 1.0; // column 2 of 4, row 1 of 3
        let pixels = upsampling([4, 3], [40, 60]).densities(&cells);
        let centroid = |of: fn(usize) -> usize| -> f64 {
            let moment = |(pixel, share): (usize, &f64)| (of(pixel) as f64 + 0.5) * share;
            pixels.iter().enumerate().map(moment).sum()
        };
        assert!((centroid(|pixel| pixel % 40) - 25.0).abs() < 1e-9);
        assert!((centroid(|pixel| pixel / 40) - 30.0).abs() < 1e-9);
    }
}
