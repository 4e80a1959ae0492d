//! Laplacian pyramid of an image (Burt and Adelson, IEEE Trans. Commun. 31 (1983) 532): bands of detail, each an octave of size.

/// The binomial filter that halves an image.
const FILTER: [f32; 5] = [1.0 / 16.0, 4.0 / 16.0, 6.0 / 16.0, 4.0 / 16.0, 1.0 / 16.0];

/// An image, row-major.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Plane {
    pub columns: usize,
    pub rows: usize,
    pub values: Vec<f32>,
}

impl Plane {
    /// Halves columns and rows after smoothing; the border is continued outwards.
    pub fn halved(&self) -> Self {
        let (columns, rows) = (self.columns.div_ceil(2), self.rows.div_ceil(2));
        let mut narrow = vec![0.0; columns * self.rows];
        for (source, target) in self
            .values
            .chunks_exact(self.columns)
            .zip(narrow.chunks_exact_mut(columns))
        {
            for (column, value) in target.iter_mut().enumerate() {
                let at = 2 * column;
                *value = if at >= 2 && at + 2 < self.columns {
                    let near = &source[at - 2..at + 3];
                    (0..5).map(|tap| FILTER[tap] * near[tap]).sum()
                } else {
                    (0..5)
                        .map(|tap| FILTER[tap] * source[clamped(at + tap, self.columns)])
                        .sum()
                };
            }
        }
        let mut values = vec![0.0; columns * rows];
        for (row, target) in values.chunks_exact_mut(columns).enumerate() {
            for (tap, share) in FILTER.iter().enumerate() {
                let source = clamped(2 * row + tap, self.rows) * columns;
                for (value, &narrow) in target.iter_mut().zip(&narrow[source..]) {
                    *value += share * narrow;
                }
            }
        }
        Self {
            columns,
            rows,
            values,
        }
    }

    /// Interpolates back to the size before halving.
    pub fn doubled(&self, columns: usize, rows: usize) -> Self {
        let mut wide = vec![0.0; columns * self.rows];
        for (source, target) in self
            .values
            .chunks_exact(self.columns)
            .zip(wide.chunks_exact_mut(columns))
        {
            for (column, value) in target.iter_mut().enumerate() {
                let [before, at, after] = neighbours(column, self.columns);
                *value = between(column, source[before], source[at], source[after]);
            }
        }
        let mut values = vec![0.0; columns * rows];
        for (row, target) in values.chunks_exact_mut(columns).enumerate() {
            let [before, at, after] =
                neighbours(row, self.rows).map(|row| &wide[row * columns..(row + 1) * columns]);
            for (column, value) in target.iter_mut().enumerate() {
                *value = between(row, before[column], at[column], after[column]);
            }
        }
        Self {
            columns,
            rows,
            values,
        }
    }
}

/// Index of tap `i − 2`, clamped to the image.
fn clamped(i: usize, length: usize) -> usize {
    i.saturating_sub(2).min(length - 1)
}

/// Samples of the halved image before, at and after a fine one.
fn neighbours(fine: usize, length: usize) -> [usize; 3] {
    let at = fine / 2;
    [at.saturating_sub(1), at, (at + 1).min(length - 1)]
}

/// Applies the filter, scaled by two, to samples with zeros in between.
fn between(fine: usize, before: f32, at: f32, after: f32) -> f32 {
    if fine.is_multiple_of(2) {
        2.0 * (FILTER[0] * (before + after) + FILTER[2] * at)
    } else {
        2.0 * FILTER[1] * (at + after)
    }
}

/// Mean standard deviation of each band of detail when the image is white noise of unit variance.
///
/// With the one-dimensional responses g of a sample of the band's image and e of its smoothed copy, the band's variance is
/// Σ (gg − ee)² = (g·g)² − 2 (g·e)² + (e·e)², averaged over the positions of e between the halved samples.
pub(crate) fn white_noise_of_bands(bands: usize) -> Vec<f64> {
    let filter = FILTER.map(f64::from);
    let mut response = vec![1.0];
    let mut noise = Vec::with_capacity(bands);
    for band in 0..bands {
        let step = 1 << band;
        let dot = |a: &[f64], a_from: i64, b: &[f64], b_from: i64| -> f64 {
            let shift = b_from - a_from;
            (0..b.len() as i64)
                .filter_map(|i| Some(a.get(usize::try_from(i + shift).ok()?)? * b[i as usize]))
                .sum()
        };
        let spread = |source: &[f64], weights: &[f64], spacing: usize| {
            let mut target = vec![0.0; source.len() + (weights.len() - 1) * spacing];
            for (tap, weight) in weights.iter().enumerate() {
                for (i, value) in source.iter().enumerate() {
                    target[i + tap * spacing] += weight * value;
                }
            }
            target
        };
        let halved = spread(&response, &filter, step);
        let even = spread(&halved, &[0.125, 0.75, 0.125], 2 * step);
        let odd = spread(&halved, &[0.5, 0.5], 2 * step);
        let from = -(response.len() as i64 - 1) / 2;
        let halved_from = from - 2 * step as i64;
        let even_from = halved_from - 2 * step as i64;
        // An odd sample is one step after the halved sample before it.
        let odd_from = halved_from - step as i64;
        let own = dot(&response, 0, &response, 0);
        let cross =
            0.5 * (dot(&even, even_from, &response, from) + dot(&odd, odd_from, &response, from));
        let smooth = 0.5 * (dot(&even, 0, &even, 0) + dot(&odd, 0, &odd, 0));
        noise.push((own * own - 2.0 * cross * cross + smooth * smooth).sqrt());
        response = halved;
    }
    noise
}

#[cfg(test)]
mod tests {
    use ppa_core::random::Philox;

    use super::*;

    fn white(columns: usize, rows: usize) -> Plane {
        let mut rng = Philox::new(3, 0, 7);
        let values = (0..columns * rows)
            .map(|_| rng.normals()[0] as f32)
            .collect();
        Plane {
            columns,
            rows,
            values,
        }
    }

    #[test]
    fn an_even_plane_stays_even_at_any_size() {
        for (columns, rows) in [(1, 1), (1, 7), (2, 3), (17, 32)] {
            let plane = Plane {
                columns,
                rows,
                values: vec![2.5; columns * rows],
            };
            let half = plane.halved();
            assert_eq!(half.columns, columns.div_ceil(2));
            for value in half
                .values
                .iter()
                .chain(&half.doubled(columns, rows).values)
            {
                assert!((value - 2.5).abs() < 1e-6);
            }
        }
    }

    /// A slope in either direction is preserved by halving and doubling away from the border.
    #[test]
    fn a_slope_comes_back() {
        let (columns, rows) = (40, 30);
        let values = (0..columns * rows)
            .map(|i| (i % columns) as f32 - 2.0 * (i / columns) as f32)
            .collect();
        let plane = Plane {
            columns,
            rows,
            values,
        };
        let back = plane.halved().doubled(columns, rows);
        for row in 6..rows - 6 {
            for column in 6..columns - 6 {
                let i = row * columns + column;
                assert!((back.values[i] - plane.values[i]).abs() < 1e-4);
            }
        }
    }

    /// Noise of the bands of 512 × 512 random pixels against the formula. Band 4 has 1024 correlated samples, so its standard
    /// error is about 3 %: bounds of 4 standard errors.
    #[test]
    fn bands_of_white_noise_have_the_stated_width() {
        let mut plane = white(512, 512);
        for (band, expected) in white_noise_of_bands(5).into_iter().enumerate() {
            let half = plane.halved();
            let smooth = half.doubled(plane.columns, plane.rows);
            let squares = plane.values.iter().zip(&smooth.values);
            let variance = squares.map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>()
                / plane.values.len() as f64;
            let ratio = variance.sqrt() / expected;
            let bound = 0.01 * f64::from(1 << band);
            assert!((ratio - 1.0).abs() < bound, "band {band}: {ratio}");
            plane = half;
        }
    }
}
