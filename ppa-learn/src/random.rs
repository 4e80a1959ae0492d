//! Random numbers by address: (seed, purpose, index) identifies a stream, independent of the order of use.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// Purpose of a stream of random numbers; streams of different purposes never share numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u64)]
pub enum Purpose {
    /// Initial values of the weights; index: the parameter's position in the network.
    Weights = 0,
    /// Dropout and stochastic depth; index: twice the training step, plus 1 for dropout.
    Dropout = 1,
    /// Images of a batch; index: the position in the endless sequence of images.
    Sampling = 2,
    /// Augmentation of one image; index: its position in the endless sequence of images.
    Augmentation = 3,
    /// Persons tested in each fold.
    Folds = 4,
    /// Initial values of the layers that join both cameras; index: the layer's position.
    FusionWeights = 5,
    /// Dropout in the layers that join both cameras; index: the training step.
    FusionDropout = 6,
    /// Seeds of the networks of both cameras; index: the camera.
    Branches = 7,
}

/// Returns the stream of random numbers at `index` of a purpose (ChaCha with 8 rounds; key from `seed`, nonce from the address).
///
/// # Panics
/// If `index` is 2^56 or more.
pub fn stream(seed: u64, purpose: Purpose, index: u64) -> ChaCha8Rng {
    assert!(
        index < 1 << 56,
        "the stream index is {index}, expected less than 2^56"
    );
    let mut stream = ChaCha8Rng::seed_from_u64(seed);
    stream.set_stream((purpose as u64) << 56 | index);
    stream
}

#[cfg(test)]
mod tests {
    use rand::Rng;

    use super::*;

    #[test]
    fn streams_depend_on_every_part_of_their_address_only() {
        let first = |seed, purpose, index| stream(seed, purpose, index).next_u64();
        let one = first(1, Purpose::Weights, 0);
        assert_eq!(one, first(1, Purpose::Weights, 0));
        assert_ne!(one, first(2, Purpose::Weights, 0));
        assert_ne!(one, first(1, Purpose::Dropout, 0));
        assert_ne!(one, first(1, Purpose::Weights, 1));
    }
}
