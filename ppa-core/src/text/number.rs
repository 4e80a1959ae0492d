//! Numbers with fixed decimals, without a negative zero.

use std::fmt;

/// A number formatted like an f64 with `{}`, `{:.2}`, `{:>9.2}` or `{:+.2}`, but without a sign if all digits are zeros.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Number(f64);

/// Numbers formatted like [`Number`], separated by a comma and a space.
#[derive(Debug, Clone, PartialEq)]
pub struct Numbers(Vec<f64>);

/// Wraps a number so that it is never shown as a negative zero: `{:.3}` of -0.0001 gives `0.000`. Without a precision, large and small
/// numbers have an exponent: `1e300`.
pub fn number(value: impl Into<f64>) -> Number {
    Number(value.into())
}

/// Wraps a list of numbers that are never shown as negative zeros: `{:.1}` gives `1.0, 2.0, 0.0`.
pub fn numbers<T: Into<f64>>(values: impl IntoIterator<Item = T>) -> Numbers {
    Numbers(values.into_iter().map(Into::into).collect())
}

impl fmt::Display for Number {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let size = self.0.abs();
        let digits = match f.precision() {
            Some(decimals) => format!("{size:.decimals$}"),
            None if size != 0.0 && !(1e-5..1e16).contains(&size) => format!("{size:e}"),
            None => size.to_string(),
        };
        let shows_zero = digits.bytes().all(|byte| matches!(byte, b'0' | b'.'));
        f.pad_integral(self.0.is_nan() || self.0 >= 0.0 || shows_zero, "", &digits)
    }
}

impl fmt::Display for Numbers {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (place, &value) in self.0.iter().enumerate() {
            if place > 0 {
                f.write_str(", ")?;
            }
            Number(value).fmt(f)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn a_zero_has_no_sign_and_other_numbers_keep_theirs() {
        for zero in [0.0, -0.0, -0.0004, 0.0004, -f64::MIN_POSITIVE] {
            assert_eq!(format!("{:.3}", number(zero)), "0.000");
            assert_eq!(format!("{:.0}", number(zero)), "0");
            assert_eq!(format!("{:+.3}", number(zero)), "+0.000");
            assert_eq!(format!("{:>8.3}", number(zero)), "   0.000");
        }
        assert_eq!(format!("{:.3}", number(-0.0006)), "-0.001");
        assert_eq!(format!("{:<8.2}|", number(-1.5)), "-1.50   |");
        assert_eq!(format!("{}", number(-0.0)), "0");
        assert_eq!(format!("{}", number(f64::NEG_INFINITY)), "-inf");
        assert_eq!(format!("{:.2}", number(f64::NAN)), "NaN");
        assert_eq!(format!("{:.2}", number(-1.25_f32)), "-1.25");
    }

    #[test]
    fn large_and_small_numbers_have_an_exponent() {
        for (value, shown) in [
            (1e300, "1e300"),
            (-2.5e-7, "-2.5e-7"),
            (1e15, "1000000000000000"),
            (1e-4, "0.0001"),
        ] {
            assert_eq!(number(value).to_string(), shown);
        }
    }

    #[test]
    fn lists_have_commas_and_no_brackets() {
        assert_eq!(format!("{:.1} mm", numbers([1.0, -0.01])), "1.0, 0.0 mm");
        assert_eq!(format!("{}", numbers([1_u8, 2, 3])), "1, 2, 3");
        assert_eq!(format!("{}", numbers::<f64>([])), "");
    }

    proptest! {
        /// Numbers are shown as f64 shows them unless that is a negative zero.
        #[test]
        fn numbers_show_as_f64_does_but_for_zeros(value in -2.0..2.0_f64, decimals in 0..5_usize, width in 0..12_usize) {
            let shown = format!("{:>width$.decimals$}", number(value));
            let plain = format!("{value:>width$.decimals$}");
            let read: f64 = shown.trim().parse().unwrap();
            prop_assert!(!(read == 0.0 && shown.contains('-')), "{shown:?}");
            if plain.trim().parse::<f64>().unwrap() != 0.0 {
                prop_assert_eq!(shown, plain);
            }
        }
    }
}
