//! Philox4x32-10, a counter-based generator.
//!
//! Salmon, Moraes, Dror, Shaw, *Parallel random numbers: as easy as 1, 2, 3*, SC 2011, doi:10.1145/2063384.2063405.

const MULTIPLIERS: [u32; 2] = [0xD251_1F53, 0xCD9E_8D57];
const WEYL: [u32; 2] = [0x9E37_79B9, 0xBB67_AE85];

/// The random numbers of one item, such as a photon history: the key is the seed, the counter (index, step, stream).
///
/// Two generators with the same seed, stream and index give the same numbers on any thread.
#[derive(Clone, Debug)]
pub struct Philox {
    key: [u32; 2],
    counter: [u32; 4],
    block: [u32; 4],
    used: usize,
}

impl Philox {
    /// Generator for item `index` of `stream`, which stands for a purpose; nothing is computed before the first draw.
    #[inline]
    pub fn new(seed: u64, stream: u32, index: u64) -> Self {
        Self::at(seed, stream, index, 0)
    }

    /// The same generator after `step` blocks of four numbers.
    #[inline]
    pub fn at(seed: u64, stream: u32, index: u64, step: u32) -> Self {
        Self {
            key: Self::key(seed),
            counter: [index as u32, (index >> 32) as u32, step, stream],
            block: [0; 4],
            used: 4,
        }
    }

    /// The same generator with `block`, the previous block, still to be drawn from; a vectorised loop may have computed it.
    #[inline]
    pub fn after(self, block: [u32; 4]) -> Self {
        Self {
            block,
            used: 0,
            ..self
        }
    }

    /// The key of a seed.
    #[inline]
    pub fn key(seed: u64) -> [u32; 2] {
        [seed as u32, (seed >> 32) as u32]
    }

    /// Number of the block after those already used or started.
    #[inline]
    pub fn step(&self) -> u32 {
        self.counter[2]
    }

    /// Uniform in [0, 1) in steps of 2⁻³²; fine enough for free paths up to 22 mean free paths per step.
    #[inline(always)]
    pub fn unit(&mut self) -> f64 {
        if self.used == 4 {
            self.refill();
        }
        let word = self.block[self.used];
        self.used += 1;
        f64::from(word) * (1.0 / 4_294_967_296.0)
    }

    /// Two independent standard normal numbers, at most 6.67 in size (Box and Muller, Ann. Math. Statist. 29 (1958) 610).
    #[inline]
    pub fn normals(&mut self) -> [f64; 2] {
        // 1 − u is in [2⁻³², 1], so the logarithm stays finite.
        let radius = (-2.0 * (1.0 - self.unit()).ln()).sqrt();
        let (sin, cos) = (std::f64::consts::TAU * self.unit()).sin_cos();
        [radius * cos, radius * sin]
    }

    #[cold]
    #[inline(never)]
    fn refill(&mut self) {
        self.block = philox(self.counter, self.key);
        self.counter[2] = self.counter[2].wrapping_add(1);
        self.used = 0;
    }
}

/// The bijection itself: four random words for a counter and a key. It has no loop, so that compilers vectorise loops around it.
#[inline(always)]
pub fn philox(counter: [u32; 4], key: [u32; 2]) -> [u32; 4] {
    let bump = |n: u32| {
        [
            key[0].wrapping_add(n.wrapping_mul(WEYL[0])),
            key[1].wrapping_add(n.wrapping_mul(WEYL[1])),
        ]
    };
    let once = round(round(counter, bump(0)), bump(1));
    let once = round(round(once, bump(2)), bump(3));
    let once = round(round(once, bump(4)), bump(5));
    let once = round(round(once, bump(6)), bump(7));
    round(round(once, bump(8)), bump(9))
}

#[inline(always)]
fn round(counter: [u32; 4], key: [u32; 2]) -> [u32; 4] {
    let product_0 = u64::from(MULTIPLIERS[0]) * u64::from(counter[0]);
    let product_1 = u64::from(MULTIPLIERS[1]) * u64::from(counter[2]);
    [
        (product_1 >> 32) as u32 ^ counter[1] ^ key[0],
        product_1 as u32,
        (product_0 >> 32) as u32 ^ counter[3] ^ key[1],
        product_0 as u32,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Known answers from the authors' Random123 distribution (`kat_vectors`).
    #[test]
    fn matches_the_published_known_answers() {
        for (counter, key, answer) in [
            (
                [0; 4],
                [0; 2],
                [0x6627_e8d5, 0xe169_c58d, 0xbc57_ac4c, 0x9b00_dbd8],
            ),
            (
                [u32::MAX; 4],
                [u32::MAX; 2],
                [0x408f_276d, 0x41c8_3b0e, 0xa20b_c7c6, 0x6d54_51fd],
            ),
            (
                [0x243f_6a88, 0x85a3_08d3, 0x1319_8a2e, 0x0370_7344],
                [0xa409_3822, 0x299f_31d0],
                [0xd16c_fe09, 0x94fd_cceb, 0x5001_e420, 0x2412_6ea1],
            ),
        ] {
            assert_eq!(philox(counter, key), answer);
        }
    }

    /// Moments of 4e4 normal numbers, and the mean product of the two of a pair, within 4.5 standard errors: 3e-5.
    #[test]
    fn normal_numbers_have_the_moments_of_the_normal_distribution() {
        let n = 20_000;
        let pairs: Vec<[f64; 2]> = (0..n).map(|i| Philox::new(2, 0, i).normals()).collect();
        let moment = |power: i32| {
            let powers = pairs.as_flattened().iter().map(|z| z.powi(power));
            powers.sum::<f64>() / (2 * n) as f64
        };
        let product = pairs.iter().map(|[a, b]| a * b).sum::<f64>() / n as f64;
        let se = (n as f64).sqrt().recip();
        for (found, expected, variance) in [
            (moment(1), 0.0, 0.5),
            (moment(2), 1.0, 1.0),
            (moment(4), 3.0, 48.0),
            (product, 0.0, 1.0),
        ] {
            let z = (found - expected) / (se * f64::sqrt(variance));
            assert!(z.abs() < 4.5, "{found}, expected {expected}: {z:.1} sigma");
        }
    }

    #[test]
    fn neighbouring_histories_are_uniform_and_uncorrelated() {
        let n = 40_000_u64;
        let (mut sum, mut product) = (0.0, 0.0);
        let mut previous = 0.5;
        for index in 0..n {
            let u = Philox::new(11, 3, index).unit();
            sum += u - 0.5;
            product += (u - 0.5) * (previous - 0.5);
            previous = u;
        }
        let n = n as f64;
        let (z_mean, z_product) = (sum / (n / 12.0).sqrt(), product / (n / 144.0).sqrt());
        assert!(
            z_mean.abs() < 4.0 && z_product.abs() < 4.0,
            "{z_mean:.1}, {z_product:.1} sigma"
        ); // 1.3e-4 per seed
    }
}
