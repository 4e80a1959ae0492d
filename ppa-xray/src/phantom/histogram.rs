//! Histogram of Hounsfield values, and saturation at its ends.

use std::collections::BTreeMap;

use serde::Serialize;

/// Width of a bin, HU.
pub(crate) const BIN_HU: u16 = 50;

/// Smallest number of voxels at an end that counts as a pile.
const SMALLEST_PILE: usize = 10;

/// Voxels at an end are a pile if the same range of HU next to it holds fewer than this share of them.
const PILE_OVER_NEIGHBOURS: f64 = 2.0;

/// Number of voxels with values from `from_hu` up to but not including `from_hu` + [`Audit::bin_hu`](crate::Audit::bin_hu).
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct HuBin {
    /// Lower edge, a multiple of the width.
    pub from_hu: f32,
    /// Number of voxels.
    pub voxels: usize,
}

/// The lowest or highest value, and its number of voxels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Extreme {
    pub hu: f32,
    pub voxels: usize,
}

/// A set of Hounsfield values.
#[derive(Debug, Clone)]
pub(crate) struct Histogram {
    /// Voxels by bin number; empty bins are omitted, since a stray value may be anywhere.
    bins: BTreeMap<i64, usize>,
    lowest: Extreme,
    highest: Extreme,
}

impl Extreme {
    /// Merges two extremes; `beyond` says whether the other value is further out.
    fn add(&mut self, other: Self, beyond: bool) {
        if beyond {
            *self = other;
        } else if other.hu == self.hu {
            self.voxels += other.voxels;
        }
    }
}

impl Histogram {
    pub fn new() -> Self {
        let nothing_yet = |hu| Extreme { hu, voxels: 0 };
        Self {
            bins: BTreeMap::new(),
            lowest: nothing_yet(f32::INFINITY),
            highest: nothing_yet(f32::NEG_INFINITY),
        }
    }

    pub fn add(&mut self, hu: f32) {
        *self.bins.entry(bin(hu)).or_default() += 1;
        let value = Extreme { hu, voxels: 1 };
        self.lowest.add(value, hu < self.lowest.hu);
        self.highest.add(value, hu > self.highest.hu);
    }

    pub fn merge(&mut self, other: &Self) {
        for (&bin, voxels) in &other.bins {
            *self.bins.entry(bin).or_default() += voxels;
        }
        self.lowest
            .add(other.lowest, other.lowest.hu < self.lowest.hu);
        self.highest
            .add(other.highest, other.highest.hu > self.highest.hu);
    }

    pub fn voxels(&self) -> usize {
        self.bins.values().sum()
    }

    /// Bins with voxels, from low to high.
    pub fn bins(&self) -> Vec<HuBin> {
        let made = |(&bin, &voxels)| HuBin {
            from_hu: bin as f32 * f32::from(BIN_HU),
            voxels,
        };
        self.bins.iter().map(made).collect()
    }

    /// Lowest and highest value; `None` without voxels.
    pub fn extremes(&self) -> Option<[Extreme; 2]> {
        (!self.bins.is_empty()).then_some([self.lowest, self.highest])
    }

    /// Voxels at the lowest value, if they pile up there.
    pub fn pile_below(&self) -> usize {
        let bin = bin(self.lowest.hu);
        let end_hu = (bin + 2) as f64 * f64::from(BIN_HU);
        self.pile(self.lowest, bin..=bin + 1, end_hu)
    }

    /// Voxels at the highest value, if they pile up there.
    pub fn pile_above(&self) -> usize {
        let bin = bin(self.highest.hu);
        let end_hu = (bin - 1) as f64 * f64::from(BIN_HU);
        self.pile(self.highest, bin - 1..=bin, end_hu)
    }

    /// A tail that is not cut off thins out: its last HU has at most the average number of voxels of the HU before it, which are
    /// those in the bins `near`, up to `end_hu`.
    fn pile(&self, at: Extreme, near: std::ops::RangeInclusive<i64>, end_hu: f64) -> usize {
        let near: usize = self.bins.range(near).map(|(_, voxels)| voxels).sum();
        let others_per_hu = (near - at.voxels) as f64 / (end_hu - f64::from(at.hu)).abs();
        let piles =
            at.voxels >= SMALLEST_PILE && at.voxels as f64 > PILE_OVER_NEIGHBOURS * others_per_hu;
        if piles { at.voxels } else { 0 }
    }
}

/// Bin of a value; values beyond any scanner's range go to the outermost bins.
fn bin(hu: f32) -> i64 {
    (hu / f32::from(BIN_HU)).floor().clamp(-1e9, 1e9) as i64
}

#[cfg(test)]
mod tests {
    use ppa_core::random::Philox;
    use proptest::prelude::*;

    use super::*;

    fn of(values: impl IntoIterator<Item = f32>) -> Histogram {
        let mut histogram = Histogram::new();
        values.into_iter().for_each(|hu| histogram.add(hu));
        histogram
    }

    proptest! {
        /// Bins hold every value exactly once, and parts merge to the full histogram.
        #[test]
        fn bins_hold_all_values(values in proptest::collection::vec(prop_oneof![-3000.0..4000.0_f32, -1e9..1e9_f32], 1..200), cut in 0.0..1.0_f64) {
            let whole = of(values.iter().copied());
            let (first, second) = values.split_at((cut * values.len() as f64) as usize);
            let mut parts = of(first.iter().copied());
            parts.merge(&of(second.iter().copied()));
            prop_assert_eq!(parts.bins(), whole.bins());
            prop_assert_eq!(parts.extremes(), whole.extremes());
            prop_assert_eq!(whole.voxels(), values.len());
            for bin in whole.bins() {
                let inside = |v: &&f32| (f64::from(**v) / 50.0).floor() as f32 * 50.0 == bin.from_hu;
                let near = values.iter().filter(inside).count();
                // Beyond 2²⁴ HU neighbouring bins share an edge in `f32`.
                prop_assert!(bin.voxels == near || bin.from_hu.abs() > 1e6);
            }
        }
    }

    /// Scanner noise around air and around metal, with and without clipping at the ends of the scale.
    #[test]
    fn clipping_is_found_and_tails_are_not_taken_for_it() {
        let values = |mean: f32| {
            (0..20_000).map(move |i| {
                let mut rng = Philox::new(7, 0, i);
                // Twelve uniform numbers: a bell of standard deviation 20 HU, which ends at 120 HU.
                let bell: f64 = (0..12).map(|_| rng.unit()).sum::<f64>() - 6.0;
                (mean + 20.0 * bell as f32).round()
            })
        };
        let open = of(values(-985.0).chain(values(40.0)).chain(values(3_060.0)));
        assert_eq!((open.pile_below(), open.pile_above()), (0, 0));
        let clip = |hu: f32| hu.clamp(-1_000.0, 3_071.0);
        let cut = |low: f32, high: f32| of(values(low).chain(values(high)).map(clip));
        let both = cut(-985.0, 3_060.0);
        let expected = [
            values(-985.0).filter(|hu| *hu <= -1_000.0).count(),
            values(3_060.0).filter(|hu| *hu >= 3_071.0).count(),
        ];
        assert!(expected.iter().all(|n| *n > 1_000));
        assert_eq!([both.pile_below(), both.pile_above()], expected);
        let above = cut(-500.0, 3_060.0);
        assert_eq!([above.pile_below(), above.pile_above()], [0, expected[1]]);
        // A pin of metal whose voxels are all clipped, far above everything else.
        let pin = of(values(40.0).chain(std::iter::repeat_n(3_071.0, 25)));
        assert_eq!((pin.pile_below(), pin.pile_above()), (0, 25));
    }
}
