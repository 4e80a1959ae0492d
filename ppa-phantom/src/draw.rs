//! Random numbers by address: the same seed, purpose and index always give the same number.

use ppa_core::random::split_mix;

/// Purpose of a random number. Part of the reproducibility contract: append, never renumber.
#[derive(Debug, Clone, Copy)]
#[repr(u8)]
pub(super) enum Purpose {
    /// A dimension of a phantom drawn by seed.
    Dimension = 1,
    /// Difference of a phantom's left limb from the mirror image of the right one.
    LeftSide = 2,
    /// The same for a phantom drawn by seed.
    LeftSideOfSeed = 3,
    /// Seed of an octave of the texture of spongy bone, and its number at a lattice point.
    Texture = 4,
    /// Noise of a voxel.
    ScannerNoise = 5,
    /// Seed of the spongy bone of a phantom of the table, by its side.
    TextureOfName = 6,
    /// The same for a phantom drawn by seed.
    TextureOfSeed = 7,
}

/// The random numbers of one seed and purpose, by index.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stream(u64);

impl Stream {
    pub(super) fn new(seed: u64, purpose: Purpose) -> Self {
        Self(split_mix(split_mix(seed) ^ u64::from(purpose as u8)))
    }

    /// 64 random bits.
    pub(super) fn bits(self, index: u64) -> u64 {
        split_mix(self.0 ^ index)
    }

    /// A uniformly distributed number with mean 0 and variance 1.
    pub(super) fn even(self, index: u64) -> f64 {
        const SCALE: f64 = 1.732_050_807_568_877_2 / (1_u64 << 63) as f64;
        self.bits(index) as i64 as f64 * SCALE
    }
}

/// 64 random bits.
pub(super) fn bits(seed: u64, purpose: Purpose, index: u64) -> u64 {
    Stream::new(seed, purpose).bits(index)
}

/// Two independent numbers above 0 and up to 1 from 64 bits.
fn two_uniform(bits: u64) -> [f64; 2] {
    [bits >> 32, bits & 0xffff_ffff].map(|half| (half as f64 + 1.0) / (1u64 << 32) as f64)
}

/// A standard normal number (Box and Muller 1958), at most 6.7 in size.
pub(super) fn normal(seed: u64, purpose: Purpose, index: u64) -> f64 {
    let [u, v] = two_uniform(bits(seed, purpose, index));
    (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
}

/// A normal number with this mean and deviation, at most two deviations from the mean and within a range that contains the
/// mean: the first number of this index that satisfies both.
pub(super) fn truncated_normal(
    (seed, purpose, index): (u64, Purpose, u64),
    [mean, deviation]: [f64; 2],
    [least, most]: [f64; 2],
) -> f64 {
    (0..1 << 32)
        .map(|attempt| normal(seed, purpose, index << 32 | attempt))
        .filter(|z| z.abs() <= 2.0)
        .map(|z| mean + deviation * z)
        .find(|value| (least..=most).contains(value))
        .unwrap_or(mean)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Moments of 2e5 numbers within 4 standard errors, 1e-4 false alarms each.
    #[test]
    fn normal_numbers_have_the_moments_of_the_normal_distribution() {
        let n = 200_000;
        let numbers: Vec<f64> = (0..n).map(|i| normal(7, Purpose::Texture, i)).collect();
        let moment = |power: i32| numbers.iter().map(|z| z.powi(power)).sum::<f64>() / n as f64;
        let error = (n as f64).sqrt().recip();
        assert!(moment(1).abs() < 4.0 * error);
        assert!((moment(2) - 1.0).abs() < 4.0 * error * 2.0_f64.sqrt());
        assert!((moment(4) - 3.0).abs() < 4.0 * error * 96.0_f64.sqrt());
        let neighbours = numbers.windows(2).map(|w| w[0] * w[1]).sum::<f64>() / n as f64;
        assert!(neighbours.abs() < 4.0 * error);
    }

    /// Variance of the normal distribution cut at two standard deviations: 1 - 4 φ(2) / (2 Φ(2) - 1) = 0.7737.
    #[test]
    fn truncated_numbers_stay_within_two_standard_deviations() {
        let n = 100_000;
        let everything = [f64::NEG_INFINITY, f64::INFINITY];
        let draw = |i, range| truncated_normal((i, Purpose::Dimension, 3), [0.0, 1.0], range);
        let numbers: Vec<f64> = (0..n).map(|i| draw(i, everything)).collect();
        assert!(numbers.iter().all(|z| z.abs() <= 2.0));
        let variance = numbers.iter().map(|z| z * z).sum::<f64>() / n as f64;
        // The fourth moment is below 16 x 0.7737, so the standard error is below 3.5 / sqrt(n).
        assert!((variance - 0.7737).abs() < 4.0 * 3.5 / (n as f64).sqrt());
        let cut: Vec<f64> = (0..n).map(|i| draw(i, [-0.5, 0.1])).collect();
        assert!(cut.iter().all(|z| (-0.5..=0.1).contains(z)));
        // Values within the limits are unchanged.
        let same = cut.iter().zip(&numbers).filter(|(a, b)| a == b).count();
        let kept = numbers.iter().filter(|z| (-0.5..=0.1).contains(*z)).count();
        assert_eq!(same, kept);
    }

    #[test]
    fn every_part_of_the_address_matters() {
        let base = bits(1, Purpose::Dimension, 1);
        assert_ne!(base, bits(2, Purpose::Dimension, 1));
        assert_ne!(base, bits(1, Purpose::Texture, 1));
        assert_ne!(base, bits(1, Purpose::Dimension, 2));
    }
}
