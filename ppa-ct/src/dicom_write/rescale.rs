//! Hounsfield units as 16-bit stored values with one rescale for all slices.

use super::decimal::decimal;
use crate::values::Values;

/// Largest stored value; the smallest is its negative.
const MOST: f64 = 32767.0;

/// HU = slope x stored + intercept; both as written, so that what a reader computes is known.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Rescale {
    pub(super) slope: String,
    pub(super) intercept: String,
}

impl Rescale {
    /// One HU per level if that is exact, otherwise the range spread over all levels.
    pub(super) fn of(hu: Values) -> Self {
        let (low, high) = hu.range();
        let (low, high) = (f64::from(low), f64::from(high));
        let (slope, intercept) = if hu.fit_i16() {
            (1.0, 0.0)
        } else if low == high {
            (1.0, low)
        } else {
            ((high - low) / (2.0 * MOST), (high + low) / 2.0)
        };
        Self {
            slope: decimal(slope),
            intercept: decimal(intercept),
        }
    }

    /// The nearest stored values.
    pub(super) fn stored(&self, hu: &[f32]) -> Vec<i16> {
        let number = |text: &str| text.parse::<f64>().expect("a decimal string of our own");
        let (slope, intercept) = (number(&self.slope), number(&self.intercept));
        hu.iter()
            .map(|&v| ((f64::from(v) - intercept) / slope).round() as i16)
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// The stated error: half a level, plus rounding to 16 characters and f32.
        #[test]
        fn values_come_back_within_half_a_level(
            hu in prop::collection::vec(-5e4..5e4_f32, 1..40),
            scale in prop::sample::select(vec![1.0_f32, 1e-6, 1e12]),
        ) {
            let hu = hu.iter().map(|v| v * scale).collect::<Vec<_>>();
            let (low, high) = Values::F32(&hu).range();
            let rescale = Rescale::of(Values::F32(&hu));
            let [slope, intercept] =
                [&rescale.slope, &rescale.intercept].map(|t| t.parse::<f64>().unwrap());
            let most = (f64::from(high) - f64::from(low)) / 131_068.0;
            for (stored, &v) in rescale.stored(&hu).into_iter().zip(&hu) {
                let error = (slope * f64::from(stored) + intercept - f64::from(v)).abs();
                prop_assert!(error <= most * 1.001 + 1e-8 * f64::from(v.abs()), "{v}: {error}");
            }
        }

        #[test]
        fn whole_values_are_stored_as_they_are(hu in prop::collection::vec(any::<i16>(), 1..40)) {
            let floats = hu.iter().map(|&v| f32::from(v)).collect::<Vec<_>>();
            let rescale = Rescale::of(Values::F32(&floats));
            prop_assert_eq!((rescale.slope.as_str(), rescale.intercept.as_str()), ("1", "0"));
            prop_assert_eq!(rescale.stored(&floats), hu);
        }
    }
}
