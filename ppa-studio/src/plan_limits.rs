//! Limits of the numbers that a plan accepts for a key, found by trying its checks.

use serde::Serialize;

use crate::plan_file::PlanFile;
use crate::plan_form::{Field, FieldKind};
use crate::plan_keys::plan_keys;

/// Largest magnitude of a limit that is searched for.
const FARTHEST: f64 = 1e9;

/// Accuracy of a limit, relative to its magnitude or to 1, whichever is larger.
const ACCURACY: f64 = 1e-9;

/// Maximum number of decimals of a limit.
const MOST_DECIMALS: i32 = 6;

/// End of the accepted numbers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct Limit {
    pub value: f64,
    /// Whether the limit itself is accepted.
    pub included: bool,
}

/// Range of accepted numbers around the current one; `None` for an end without a limit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct Limits {
    pub low: Option<Limit>,
    pub high: Option<Limit>,
}

/// Returns the limits of a field with everything else as in `text`; `None` if the field has no accepted number, or if probes
/// beyond the limits are accepted.
pub(crate) fn limits(file: &PlanFile, text: &str, field: &Field) -> Option<Limits> {
    if field.kind != FieldKind::Number {
        return None;
    }
    let now = field.value.as_deref().or(field.default.as_deref());
    let now: f64 = now.or(field.example)?.parse().ok()?;
    let is_whole = plan_keys().any(|key| key.key == field.key && key.kind == "integer");
    let accepts = |value: f64| {
        let typed = match is_whole {
            true => format!("{value:.0}"),
            false => format!("{value:?}"),
        };
        let is_of_type = !is_whole || value.fract() == 0.0;
        is_of_type && file.changed(text, &field.key, Some(&typed)).is_ok()
    };
    if !accepts(now) {
        return None;
    }
    let limits = Limits {
        low: limit(now, -1.0, is_whole, accepts),
        high: limit(now, 1.0, is_whole, accepts),
    };
    let is_beyond = |value: f64| {
        limits.low.is_some_and(|low| value < low.value)
            || limits.high.is_some_and(|high| value > high.value)
    };
    let has_gaps = probes(now).any(|value| is_beyond(value) && accepts(value));
    (!has_gaps).then_some(limits)
}

/// Returns round numbers near and far from `now`. If only some numbers are accepted, such as multiples of 0.5 degrees, they include some.
fn probes(now: f64) -> impl Iterator<Item = f64> {
    let steps = (0..12).map(|k| 0.5 * 2_f64.powi(k));
    let sums = steps.flat_map(move |step| [now - step, now + step]);
    let products = (1..5).map(|k| 2_f64.powi(k));
    sums.chain(products.flat_map(move |factor| [now / factor, now * factor]))
}

/// Finds the end of the accepted numbers from `start` upwards (`sign` 1) or downwards (-1): growing steps up to the first
/// refused number, then bisection.
fn limit(start: f64, sign: f64, is_whole: bool, accepts: impl Fn(f64) -> bool) -> Option<Limit> {
    let first = if is_whole {
        1.0
    } else {
        1e-3 * start.abs().max(1.0)
    };
    let (mut inside, mut step) = (start, sign * first);
    let mut outside = loop {
        let next = start + step;
        if next.abs() > FARTHEST {
            return None;
        }
        if !accepts(next) {
            break next;
        }
        (inside, step) = (next, 4.0 * step);
    };
    loop {
        let middle = 0.5 * (inside + outside);
        let middle = match (is_whole, sign > 0.0) {
            (false, _) => middle,
            (true, true) => middle.floor(),
            (true, false) => middle.ceil(),
        };
        if middle == inside || (outside - inside).abs() <= tolerance(outside) {
            break;
        }
        match accepts(middle) {
            true => inside = middle,
            false => outside = middle,
        }
    }
    let value = match is_whole {
        true => inside,
        false => roundest(inside, outside).unwrap_or(inside),
    };
    Some(Limit {
        // Avoids a negative zero.
        value: value + 0.0,
        included: accepts(value),
    })
}

fn tolerance(value: f64) -> f64 {
    ACCURACY * value.abs().max(1.0)
}

/// Returns the number with the fewest decimals between two others, or within the tolerance of them.
fn roundest(a: f64, b: f64) -> Option<f64> {
    let (middle, most) = (0.5 * (a + b), 0.5 * (a - b).abs() + tolerance(b));
    let rounded = (0..=MOST_DECIMALS).map(|decimals| {
        let scale = 10_f64.powi(decimals);
        (middle * scale).round() / scale
    });
    rounded
        .into_iter()
        .find(|value| (value - middle).abs() <= most)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(start: f64, sign: f64, is_whole: bool, accepts: impl Fn(f64) -> bool) -> (f64, bool) {
        let limit = limit(start, sign, is_whole, accepts).unwrap();
        (limit.value, limit.included)
    }

    #[test]
    fn limits_are_exact_and_say_if_they_belong() {
        let within = |x: f64| x > 0.0 && x <= 0.35;
        assert_eq!(found(0.1, -1.0, false, within), (0.0, false));
        assert_eq!(found(0.1, 1.0, false, within), (0.35, true));
        let below = |x: f64| x < 1200.5;
        assert_eq!(found(-3.0, 1.0, false, below), (1200.5, false));
        let whole = |x: f64| (1.0..=4096.0).contains(&x);
        assert_eq!(found(7.0, -1.0, true, whole), (1.0, true));
        assert_eq!(found(7.0, 1.0, true, whole), (4096.0, true));
        assert_eq!(found(4096.0, 1.0, true, whole), (4096.0, true));
        assert_eq!(limit(7.0, 1.0, false, |_| true), None);
    }

    #[test]
    fn a_limit_without_a_round_value_is_accepted() {
        let third = |x: f64| x <= 1.0 / 3.0;
        let (value, included) = found(0.0, 1.0, false, third);
        assert!(included && (value - 1.0 / 3.0).abs() < 1e-8, "{value}");
    }
}
