//! Kernel ridge regression on small images, as a baseline without a network (Saunders, Gammerman & Vovk, ICML 1998).

use nalgebra::{DMatrix, DVector};

/// Ridge parameters that are tried.
const RIDGES: [f64; 4] = [1e-3, 1e-2, 1e-1, 1.0];
/// Ridge parameter if all points are of one group.
const RIDGE_OF_ONE_GROUP: f64 = 1e-2;
/// Maximum number of points whose distances determine the width of the kernel.
const WIDTH_POINTS: usize = 200;
/// The middle of the labels, 1 to 3.
const MIDDLE: f64 = 2.0;

/// A regression with the kernel 1 + exp(−d² / 2w²), where w is the median distance of the points.
#[derive(Debug)]
pub(super) struct KernelRidge {
    points: Vec<Vec<f32>>,
    weights: DVector<f64>,
    width2: f64,
}

impl KernelRidge {
    /// Fits the labels of points with the ridge parameter whose mean absolute error is lowest when each group is predicted from the others.
    ///
    /// # Panics
    /// If there are no points, or not one label and one group for each.
    pub fn fit(points: Vec<Vec<f32>>, labels: &[f64], groups: &[usize]) -> Self {
        let n = points.len();
        assert!(n > 0 && labels.len() == n && groups.len() == n);
        let width2 = median_squared_distance(&points);
        let mut kernel = DMatrix::zeros(n, n);
        for i in 0..n {
            for j in 0..=i {
                let value = similarity(&points[i], &points[j], width2);
                kernel[(i, j)] = value;
                kernel[(j, i)] = value;
            }
        }
        let labels = DVector::from_iterator(n, labels.iter().map(|label| label - MIDDLE));
        let places = places(groups);
        let ridges = match places.len() {
            1 => &[RIDGE_OF_ONE_GROUP][..],
            _ => &RIDGES,
        };
        let fits = ridges.iter().map(|&ridge| {
            let inverse = inverse(&kernel + DMatrix::identity(n, n) * ridge);
            let weights = &inverse * &labels;
            (left_out_error(&inverse, &weights, &places), weights)
        });
        let best = fits.min_by(|a, b| a.0.total_cmp(&b.0));
        let (_, weights) = best.expect("there are ridges");
        Self {
            points,
            weights,
            width2,
        }
    }

    /// Predicts the label of a point.
    pub fn predict(&self, point: &[f32]) -> f64 {
        let near = self.points.iter();
        let near = near.map(|other| similarity(other, point, self.width2));
        MIDDLE
            + near
                .zip(&self.weights)
                .map(|(near, weight)| near * weight)
                .sum::<f64>()
    }
}

/// Kernel of two points. The constant 1 models an offset that is regularised like the rest.
fn similarity(a: &[f32], b: &[f32], width2: f64) -> f64 {
    1.0 + (-squared_distance(a, b) / (2.0 * width2)).exp()
}

fn squared_distance(a: &[f32], b: &[f32]) -> f64 {
    a.iter()
        .zip(b)
        .map(|(a, b)| f64::from((a - b).powi(2)))
        .sum()
}

/// Returns the median over pairs of different points among at most [`WIDTH_POINTS`] evenly spaced points; 1 if all are equal.
fn median_squared_distance(points: &[Vec<f32>]) -> f64 {
    let some: Vec<&Vec<f32>> = points
        .iter()
        .step_by(points.len().div_ceil(WIDTH_POINTS))
        .collect();
    let mut distances: Vec<f64> = (0..some.len())
        .flat_map(|i| (0..i).map(move |j| (i, j)))
        .map(|(i, j)| squared_distance(some[i], some[j]))
        .filter(|&distance| distance > 0.0)
        .collect();
    distances.sort_by(f64::total_cmp);
    distances.get(distances.len() / 2).copied().unwrap_or(1.0)
}

/// Returns the indices of each group's points.
fn places(groups: &[usize]) -> Vec<Vec<usize>> {
    let mut names = groups.to_vec();
    names.sort_unstable();
    names.dedup();
    let of = |name: &usize| {
        (0..groups.len())
            .filter(|&at| groups[at] == *name)
            .collect()
    };
    names.iter().map(of).collect()
}

fn inverse(matrix: DMatrix<f64>) -> DMatrix<f64> {
    let cholesky = matrix.cholesky();
    cholesky
        .expect("a kernel plus a ridge is positive definite")
        .inverse()
}

/// Returns the mean absolute error of all points, each predicted without its group: the errors e of a group solve A e = w, where A is the
/// group's block of the inverse and w its part of the weights (block form of the leave-one-out formula).
fn left_out_error(inverse: &DMatrix<f64>, weights: &DVector<f64>, places: &[Vec<usize>]) -> f64 {
    let error = |places: &Vec<usize>| {
        let own = inverse.select_rows(places).select_columns(places);
        let weights = weights.select_rows(places);
        let cholesky = own.cholesky().expect("part of a positive definite matrix");
        cholesky.solve(&weights).abs().sum()
    };
    places.iter().map(error).sum::<f64>() / weights.len() as f64
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Points on a curve in three dimensions with labels that vary along it.
    fn curve(n: usize) -> (Vec<Vec<f32>>, Vec<f64>) {
        let at = |i: usize| i as f32 / n as f32;
        let points = (0..n).map(|i| vec![at(i), at(i).sin(), (3.0 * at(i)).cos()]);
        let labels = (0..n).map(|i| 1.0 + 2.0 * f64::from(at(i)).powi(2));
        (points.collect(), labels.collect())
    }

    #[test]
    fn labels_along_a_curve_are_found() {
        let (points, labels) = curve(40);
        let groups: Vec<usize> = (0..40).map(|i| i % 5).collect();
        let known: Vec<usize> = (0..40).filter(|i| i % 5 != 3).collect();
        let of = |all: &[f64]| known.iter().map(|&i| all[i]).collect::<Vec<_>>();
        let fit = KernelRidge::fit(
            known.iter().map(|&i| points[i].clone()).collect(),
            &of(&labels),
            &known.iter().map(|&i| groups[i]).collect::<Vec<_>>(),
        );
        for i in (0..40).filter(|i| i % 5 == 3) {
            let found = fit.predict(&points[i]);
            assert!((found - labels[i]).abs() < 0.05, "{found}, {}", labels[i]);
        }
    }

    #[test]
    fn equal_points_get_their_mean_label() {
        let fit = KernelRidge::fit(vec![vec![0.5]; 4], &[1.0, 2.0, 2.0, 3.0], &[0, 0, 0, 0]);
        assert!((fit.predict(&[0.5]) - 2.0).abs() < 1e-9);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(16))]
        #[test]
        fn left_out_errors_are_those_of_fits_without_the_group(labels in proptest::collection::vec(1.0..3.0_f64, 12)) {
            let (points, _) = curve(12);
            let groups: Vec<usize> = (0..12).map(|i| i / 4).collect();
            let width2 = median_squared_distance(&points);
            let kernel = |rows: &[usize], columns: &[usize]| {
                DMatrix::from_fn(rows.len(), columns.len(), |i, j| similarity(&points[rows[i]], &points[columns[j]], width2))
            };
            let all: Vec<usize> = (0..12).collect();
            let y = |places: &[usize]| DVector::from_iterator(places.len(), places.iter().map(|&i| labels[i] - MIDDLE));
            let ridge = 0.1;
            let whole = inverse(kernel(&all, &all) + DMatrix::identity(12, 12) * ridge);
            let found = left_out_error(&whole, &(&whole * y(&all)), &places(&groups));
            let mut expected = 0.0;
            for group in 0..3 {
                let (own, others): (Vec<usize>, Vec<usize>) = all.iter().partition(|&&i| groups[i] == group);
                let fit = inverse(kernel(&others, &others) + DMatrix::identity(8, 8) * ridge) * y(&others);
                expected += (kernel(&own, &others) * fit - y(&own)).abs().sum();
            }
            prop_assert!((found - expected / 12.0).abs() < 1e-8, "{found}, {}", expected / 12.0);
        }
    }
}
