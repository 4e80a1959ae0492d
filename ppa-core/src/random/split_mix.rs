//! SplitMix64: Steele, Lea and Flood, *Fast splittable pseudorandom number generators*, OOPSLA 2014,
//! doi:10.1145/2660193.2660195.

/// Increment of the generator's state: the odd number next to 2⁶⁴ / golden ratio.
const GAMMA: u64 = 0x9E37_79B9_7F4A_7C15;

/// Returns the next number of a generator in this state: every bit of the state affects every bit of it.
#[inline]
pub fn split_mix(state: u64) -> u64 {
    let z = state.wrapping_add(GAMMA);
    let z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

/// Returns number `index`, counted from 0, of the generator that starts in `state`.
#[inline]
pub fn split_mix_at(state: u64, index: u64) -> u64 {
    split_mix(state.wrapping_add(index.wrapping_mul(GAMMA)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sequence for seed 1234567, from Rosetta Code, *Pseudo-random numbers/Splitmix64*.
    #[test]
    fn matches_the_published_sequence() {
        let expected: [u64; 5] = [
            6_457_827_717_110_365_317,
            3_203_168_211_198_807_973,
            9_817_491_932_198_370_423,
            4_593_380_528_125_082_431,
            16_408_922_859_458_223_821,
        ];
        for (index, expected) in (0..).zip(expected) {
            assert_eq!(split_mix_at(1_234_567, index), expected);
        }
        assert_eq!(split_mix(1_234_567), expected[0]);
    }
}
