//! Integrals of Thomson's law times a squared form factor over all directions.

use std::f64::consts::PI;

/// Square of the classical electron radius in cm² (CODATA 2018) times Avogadro's number in 1/mol.
const RADIUS_SQUARED_CM2_MOL: f64 = 7.940_787_7e-26 * 6.022_140_76e23;

/// F² over x = q², linear between nodes, and its moments from x = 0.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ThomsonIntegral {
    x: Vec<f64>,
    squared: Vec<f64>,
    /// ∫ xᵏ F² dx up to each node for k = 0, 1, 2.
    moments: Vec<[f64; 3]>,
}

impl ThomsonIntegral {
    /// Takes nodes x in 1/Å², ascending from 0, and the values of F² at the nodes.
    pub(crate) fn new(x: Vec<f64>, squared: Vec<f64>) -> Self {
        let mut sums = [0.0; 3];
        let mut moments = vec![sums];
        for (x, squared) in x.windows(2).zip(squared.windows(2)) {
            add(&mut sums, [x[0], x[1]], [squared[0], squared[1]]);
            moments.push(sums);
        }
        Self {
            x,
            squared,
            moments,
        }
    }

    /// ∫ F² (1 + cos²θ) dΩ, with x = `backward` at θ = 180°.
    ///
    /// With u = x / `backward` = sin²(θ/2), 1 + cos²θ = 2 − 4u + 4u² and dΩ = 4π du.
    pub(crate) fn over_the_sphere(&self, backward: f64) -> f64 {
        let upper = self
            .x
            .partition_point(|&node| node <= backward)
            .clamp(1, self.x.len() - 1);
        let [x0, x1] = [self.x[upper - 1], self.x[upper]];
        let [y0, y1] = [self.squared[upper - 1], self.squared[upper]];
        let at_end = y0 + (y1 - y0) * (backward - x0) / (x1 - x0);
        let mut sums = self.moments[upper - 1];
        add(&mut sums, [x0, backward], [y0, at_end]);
        let [m0, m1, m2] = sums;
        8.0 * PI / backward * (m0 + 2.0 * (m2 / backward - m1) / backward)
    }

    /// Cross section in cm²/g if F² is divided by the molar mass, in mol/g.
    pub(crate) fn cm2_g(&self, backward: f64) -> f64 {
        0.5 * RADIUS_SQUARED_CM2_MOL * self.over_the_sphere(backward)
    }
}

/// Adds ∫ xᵏ y dx of a linear y between two nodes, by Simpson's rule, which is exact up to the third power.
fn add(sums: &mut [f64; 3], [x0, x1]: [f64; 2], [y0, y1]: [f64; 2]) {
    let points = [(x0, y0), (0.5 * (x0 + x1), 2.0 * (y0 + y1)), (x1, y1)];
    for (x, weighted) in points {
        let share = weighted * (x1 - x0) / 6.0;
        sums[0] += share;
        sums[1] += share * x;
        sums[2] += share * x * x;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// F² = a + b x: ∫ (a + b B u)(2 − 4u + 4u²) 4π du = 4π (4a/3 + 2bB/3), exactly.
    #[test]
    fn a_straight_line_gives_its_closed_form() {
        let line = |x: f64| 3.0 - 0.5 * x;
        let x = vec![0.0, 0.3, 1.1, 4.0];
        let squared = x.iter().map(|&x| line(x)).collect();
        let integral = ThomsonIntegral::new(x, squared);
        for backward in [0.1, 0.3, 0.7, 3.9, 4.0] {
            let expected = 4.0 * PI * (4.0 * 3.0 / 3.0 - 2.0 * 0.5 * backward / 3.0);
            let found = integral.over_the_sphere(backward);
            assert!((found / expected - 1.0).abs() < 1e-12, "{backward}");
        }
    }

    /// One free electron per gram and mole has the cross section 8π/3 rₑ² N_A = 0.4006 cm²/g.
    #[test]
    fn constant_form_factor_gives_the_thomson_cross_section() {
        let integral = ThomsonIntegral::new(vec![0.0, 200.0], vec![1.0; 2]);
        let thomson = 8.0 / 3.0 * PI * 0.079_407_877 * 0.602_214_076;
        assert!((integral.cm2_g(3.0) / thomson - 1.0).abs() < 1e-12);
        assert!((thomson - 0.400_6).abs() < 1e-4);
    }
}
