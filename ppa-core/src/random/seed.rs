//! Seeds from the text of an address.

use sha2::{Digest, Sha256};

/// Returns the seed of an address such as `1/radiograph/0/r/36`: the first eight bytes of the SHA-256 of the text, little-endian.
pub fn seed_of_address(address: &str) -> u64 {
    let digest = Sha256::digest(address.as_bytes());
    u64::from_le_bytes(std::array::from_fn(|byte| digest[byte]))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// SHA-256 of `abc` begins with ba7816bf 8f01cfea (FIPS 180-2, appendix B.1).
    #[test]
    fn seeds_are_the_first_bytes_of_the_hash() {
        assert_eq!(seed_of_address("abc"), 0xeacf_018f_bf16_78ba);
    }
}
