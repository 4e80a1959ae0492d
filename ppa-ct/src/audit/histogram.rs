//! Histogram of HU.

use rayon::prelude::*;

use crate::values::Values;

/// Lowest and highest HU with a bin of its own; values beyond them are counted in the outermost bins.
const LOW: i32 = -3100;
const HIGH: i32 = 4100;
/// Standard deviation of the smoothing that merges noise into one peak, HU.
const SMOOTHING_HU: f64 = 10.0;

/// Counts of voxels per HU, rounded to whole numbers.
pub(super) struct Histogram {
    counts: Vec<u64>,
    pub total: u64,
    pub min: f32,
    pub max: f32,
    pub at_min: u64,
    pub at_max: u64,
    /// Voxels less than 10.5 HU below the highest value, excluding that value.
    pub near_max: u64,
}

impl Histogram {
    pub fn of(hu: Values) -> Self {
        let (min, max) = hu.range();
        let bins = (HIGH - LOW + 1) as usize;
        // Integers: the sum is the same in any order.
        let parts = hu.par_parts(1 << 20).map(|values| {
            let mut counts = vec![0_u64; bins + 3];
            let mut count = |bin: usize, value: f32| {
                counts[bin] += 1;
                counts[bins] += u64::from(value == min);
                counts[bins + 1] += u64::from(value == max);
                counts[bins + 2] += u64::from(value > max - 10.5 && value < max);
            };
            match values {
                Values::I16(values) => {
                    let values = values.iter().map(|&v| (whole_bin(v.into()), v.into()));
                    values.for_each(|(bin, value)| count(bin, value));
                }
                Values::F32(values) => values.iter().for_each(|&v| count(bin(v), v)),
            }
            counts
        });
        let add = |mut a: Vec<u64>, b: Vec<u64>| {
            a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
            a
        };
        let mut counts = parts.reduce(|| vec![0; bins + 3], add);
        let (near_max, at_max, at_min) = (counts[bins + 2], counts[bins + 1], counts[bins]);
        counts.truncate(bins);
        Self {
            counts,
            total: hu.len() as u64,
            min,
            max,
            at_min,
            at_max,
            near_max,
        }
    }

    /// Voxels above `hu`.
    pub fn above(&self, hu: f32) -> u64 {
        self.counts[bin(hu) + 1..].iter().sum()
    }

    /// Voxels from `low` to `high` HU, both included.
    pub fn between(&self, low: f32, high: f32) -> u64 {
        self.counts[bin(low)..=bin(high)].iter().sum()
    }

    /// The HU below which a `share` of all voxels is found.
    pub fn quantile(&self, share: f64) -> f64 {
        let wanted = share * self.total as f64;
        let mut sum = 0;
        for (bin, count) in self.counts.iter().enumerate() {
            sum += count;
            if sum as f64 >= wanted {
                return f64::from(LOW + bin as i32);
            }
        }
        f64::from(HIGH)
    }

    /// The HU of the maximum of the smoothed histogram from `low` to `high`, if at least a share `least` of
    /// all voxels is within 50 HU of it.
    pub fn peak(&self, low: f32, high: f32, least: f64) -> Option<f64> {
        let reach = (3.0 * SMOOTHING_HU) as usize;
        let smoothed = |at: usize| {
            let from = at.saturating_sub(reach);
            let to = (at + reach).min(self.counts.len() - 1);
            (from..=to)
                .map(|n| {
                    let away = (n as f64 - at as f64) / SMOOTHING_HU;
                    self.counts[n] as f64 * (-0.5 * away * away).exp()
                })
                .sum::<f64>()
        };
        let heights = (bin(low)..=bin(high)).map(|at| (at, smoothed(at)));
        let (at, _) = heights.max_by(|a, b| a.1.total_cmp(&b.1))?;
        let hu = LOW + at as i32;
        let near = self.between((hu - 50) as f32, (hu + 50) as f32);
        let share = near as f64 / self.total as f64;
        (share >= least).then_some(f64::from(hu))
    }
}

fn bin(hu: f32) -> usize {
    whole_bin(hu.round() as i32)
}

fn whole_bin(hu: i32) -> usize {
    hu.clamp(LOW, HIGH).abs_diff(LOW) as usize
}
