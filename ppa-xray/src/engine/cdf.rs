//! Sampling from a discrete distribution by its cumulative sums.
//!
//! Inverse transform: docs/physics.md, "Fast engine", first collisions.

use std::ops::Range;

/// An entry found in strided cumulative sums.
pub(super) struct Entry {
    pub index: usize,
    /// The sum before the entry, and its own contribution.
    pub low: f64,
    pub size: f64,
    /// Position of the target in the entry, 0 to 1.
    pub inside: f64,
}

impl Entry {
    /// Returns the entry in `range` that contains `target`; entry i ends with the sum at (i + 1) · stride − 1.
    #[inline]
    pub fn find(sums: &[f64], stride: usize, range: Range<usize>, target: f64) -> Self {
        let end = |index: usize| sums[(index + 1) * stride - 1];
        let (mut first, mut last) = (range.start, range.end - 1);
        while first < last {
            let middle = (first + last) / 2;
            if end(middle) <= target {
                first = middle + 1;
            } else {
                last = middle;
            }
        }
        let low = if first == 0 { 0.0 } else { end(first - 1) };
        let size = end(first) - low;
        Self {
            index: first,
            low,
            size,
            inside: ((target - low) / size).clamp(0.0, 1.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Weights 1, 2, 3, 4, 5, 6 in three pairs: every target is found in the entry whose share contains it.
    #[test]
    fn entries_are_found_by_their_share() {
        let sums = [1.0, 3.0, 6.0, 10.0, 15.0, 21.0];
        for (stride, target, index, low, size) in [
            (1, 0.0, 0, 0.0, 1.0),
            (1, 2.5, 1, 1.0, 2.0),
            (1, 3.0, 2, 3.0, 3.0),
            (1, 20.9, 5, 15.0, 6.0),
            (2, 2.9, 0, 0.0, 3.0),
            (2, 3.0, 1, 3.0, 7.0),
            (2, 20.9, 2, 10.0, 11.0),
        ] {
            let found = Entry::find(&sums, stride, 0..sums.len() / stride, target);
            assert_eq!(
                (found.index, found.low, found.size),
                (index, low, size),
                "{target}"
            );
            assert_eq!(found.inside, (target - low) / size);
        }
        // Rounding may put a target beyond the entries that are searched.
        let last = Entry::find(&sums, 1, 2..4, 10.0);
        assert_eq!((last.index, last.inside), (3, 1.0));
    }
}
