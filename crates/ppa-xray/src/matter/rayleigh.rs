//! Rayleigh scattering: Thomson's law times the squared form factor of independent atoms.

use crate::{
    matter::cross_sections::HC_KEV_ANGSTROM, matter::material::Material, octaves::Octaves,
    philox::Philox,
};

/// Entries of the table that says where in the cumulative distribution to start looking.
const GUIDE: usize = 1024;

/// Sampler of Rayleigh scattering in one material.
///
/// With x = q², q = sin(θ/2) E/hc, the distribution is F²(x) dx · (1 + cos²θ)/2: x from the inverse of the
/// cumulative ∫F² dx up to its backward value, then rejection (Baró et al. 1994, doi:10.1016/0969-806X(94)90083-3).
#[derive(Clone, Debug)]
pub(crate) struct Rayleigh {
    grid: Octaves,
    /// Node positions: 0, then the grid.
    x: Vec<f64>,
    /// F² at the nodes, linear in x between.
    squared: Vec<f64>,
    /// ∫F² dx from 0 to each node.
    cumulative: Vec<f64>,
    /// Last node whose cumulative value does not exceed k/GUIDE of the whole.
    guide: Vec<u16>,
    guide_per_unit: f64,
}

impl Rayleigh {
    pub(crate) fn new(material: &Material, grid: Octaves) -> Self {
        let x: Vec<f64> = std::iter::once(0.0).chain(grid.nodes()).collect();
        let squared: Vec<f64> = x
            .iter()
            .map(|x| material.form_factor_squared_per_gram(x.sqrt()))
            .collect();
        let mut cumulative = vec![0.0];
        for i in 1..x.len() {
            cumulative
                .push(cumulative[i - 1] + 0.5 * (squared[i - 1] + squared[i]) * (x[i] - x[i - 1]));
        }
        let whole = cumulative[x.len() - 1];
        let guide = (0..=GUIDE)
            .map(|k| {
                let target = whole * k as f64 / GUIDE as f64;
                (cumulative
                    .partition_point(|&c| c <= target)
                    .clamp(1, x.len() - 1)
                    - 1) as u16
            })
            .collect();
        Self {
            grid,
            x,
            squared,
            cumulative,
            guide,
            guide_per_unit: GUIDE as f64 / whole,
        }
    }

    /// ∫F² dx from 0 to `x`.
    #[inline]
    fn integral(&self, x: f64) -> f64 {
        let bin = if x < self.grid.first() {
            0
        } else {
            self.grid.locate(x).0 + 1
        };
        let (d, width) = (x - self.x[bin], self.x[bin + 1] - self.x[bin]);
        let slope = (self.squared[bin + 1] - self.squared[bin]) / width;
        self.cumulative[bin] + d * (self.squared[bin] + 0.5 * slope * d)
    }

    /// Cosine of the scattering angle.
    #[inline]
    pub(crate) fn sample(&self, energy_kev: f64, random: &mut Philox) -> f64 {
        let x_backwards = (energy_kev * (1.0 / HC_KEV_ANGSTROM)).powi(2);
        let whole = self.integral(x_backwards);
        loop {
            let target = random.unit() * whole;
            let mut bin = usize::from(self.guide[(target * self.guide_per_unit) as usize]);
            while self.cumulative[bin + 1] < target {
                bin += 1;
            }
            let rest = target - self.cumulative[bin];
            let slope =
                (self.squared[bin + 1] - self.squared[bin]) / (self.x[bin + 1] - self.x[bin]);
            // Root of F² d + ½ slope d² = rest that does not cancel.
            let root = (self.squared[bin] * self.squared[bin] + 2.0 * slope * rest)
                .max(0.0)
                .sqrt();
            let x = self.x[bin] + 2.0 * rest / (self.squared[bin] + root);
            let cos = (1.0 - 2.0 * x / x_backwards).max(-1.0);
            if 2.0 * random.unit() < 1.0 + cos * cos {
                return cos;
            }
        }
    }
}
