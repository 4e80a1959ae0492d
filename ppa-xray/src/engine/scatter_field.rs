//! Scatter over the whole detector: estimates at nodes interpolated to pixels, with their standard errors.
//!
//! docs/physics.md, "Fast engine", precision.

use crate::beam::detector::Detector;
use crate::engine::node_grid::NodeGrid;
use crate::transport::tally::Moments;

/// Independent estimates of one category at the nodes of a grid, energy per cm² and history.
#[derive(Debug)]
pub(crate) struct ScatterField {
    pub grid: NodeGrid,
    /// Moments by estimate, then by node.
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
                    // Next to zero values the cubics may become negative.
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

    /// Covariance of the errors of the mean energies of two fields on one grid in every pixel, keV²; for a field with
    /// itself, their variance.
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

    /// Deviations of the estimates from their mean.
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

#[cfg(test)]
mod tests {
    use ppa_core::random::Philox;

    use super::*;
    use crate::engine::first_collisions::ESTIMATES;

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

    /// Var(a + b) = Var(a) + Var(b) + 2 Cov(a, b) in every pixel, for any correlation of the estimates of a and b.
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
