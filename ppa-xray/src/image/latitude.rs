//! Latitude reduction: reduces the range of log exposure of large areas to what can be displayed.

/// Divides contrast by 1 + r |a| at log exposure a, where r is the field: t = sign(a) ln(1 + r |a|) / r, and t = a for r = 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct LatitudeReduction(pub f64);

impl LatitudeReduction {
    /// Log exposure after the reduction.
    pub fn reduced(self, log_exposure: f64) -> f64 {
        if self.0 == 0.0 {
            return log_exposure;
        }
        ((self.0 * log_exposure.abs()).ln_1p() / self.0).copysign(log_exposure)
    }

    /// Log exposure before the reduction; the inverse of [`LatitudeReduction::reduced`].
    pub fn restored(self, reduced: f64) -> f64 {
        if self.0 == 0.0 {
            return reduced;
        }
        ((self.0 * reduced.abs()).exp_m1() / self.0).copysign(reduced)
    }

    /// Divisor of the contrast at the given reduced log exposure: 1 + r |a| = exp(r |t|).
    pub fn divisor(self, reduced: f64) -> f64 {
        (self.0 * reduced.abs()).exp()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn contrast_is_divided_as_stated_and_order_kept() {
        for reduction in [0.0, 0.1, 0.5, 3.0].map(LatitudeReduction) {
            assert_eq!(reduction.reduced(0.0), 0.0);
            for i in -40..200 {
                let a = 0.05 * f64::from(i);
                let t = reduction.reduced(a);
                assert!((reduction.restored(t) - a).abs() < 1e-12);
                let divisor = 1.0 + reduction.0 * a.abs();
                assert!((reduction.divisor(t) / divisor - 1.0).abs() < 1e-12);
                let slope = (reduction.reduced(a + 1e-4) - reduction.reduced(a - 1e-4)) / 2e-4;
                // A kink of the second derivative at 0 allows r × 1e-4.
                assert!((slope * divisor - 1.0).abs() < 4e-4, "{a}: {slope}");
            }
        }
    }
}
