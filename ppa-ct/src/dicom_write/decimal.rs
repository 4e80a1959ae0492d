//! Numbers as DICOM decimal strings.

/// Longest decimal string (PS3.5, section 6.2).
const CHARACTERS: usize = 16;

/// Returns the decimal string nearest to a finite number.
pub(super) fn decimal(value: f64) -> String {
    let exact = value.to_string();
    if exact.len() <= CHARACTERS {
        return exact;
    }
    let fixed = (0..=14).rev().map(|digits| format!("{value:.digits$}"));
    let scientific = (0..=14).rev().map(|digits| format!("{value:.digits$e}"));
    let error = |text: &String| (text.parse::<f64>().unwrap_or(f64::INFINITY) - value).abs();
    fixed
        .chain(scientific)
        .filter(|text| text.len() <= CHARACTERS)
        .min_by(|a, b| error(a).total_cmp(&error(b)))
        .unwrap_or(exact)
}

/// Joins several decimal strings in one value.
pub(super) fn decimals(values: impl IntoIterator<Item = f64>) -> String {
    values
        .into_iter()
        .map(decimal)
        .collect::<Vec<_>>()
        .join("\\")
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Sign, point and an exponent such as `e-300` leave at least eight digits.
        #[test]
        fn decimal_strings_fit_and_say_the_number(
            mantissa in -1.0..1.0_f64,
            exponent in -300..300_i32,
        ) {
            let value = mantissa * 10.0_f64.powi(exponent);
            let text = decimal(value);
            prop_assert!(text.len() <= 16, "{text}");
            let back = text.parse::<f64>().unwrap();
            prop_assert!((back - value).abs() <= 1e-8 * value.abs(), "{text}");
        }

        /// A direction cosine, or a position of less than a metre: 12 places behind the point.
        #[test]
        fn places_are_reported_to_a_millionth_of_a_micrometre(value in -999.0..999.0_f64) {
            let back = decimal(value).parse::<f64>().unwrap();
            prop_assert!((back - value).abs() <= 0.6e-11, "{value}");
        }
    }
}
