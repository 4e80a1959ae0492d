//! Unique identifiers derived from content.

use sha2::{Digest, Sha256};

/// A UID under the root 2.25: a UUID of version 8 (RFC 9562) from the hash of the parts, as a decimal number.
pub(super) fn of(parts: &[&[u8]]) -> String {
    let mut hash = Sha256::new();
    hash.update(b"ppa-xray");
    for part in parts {
        hash.update((part.len() as u64).to_le_bytes());
        hash.update(part);
    }
    let digest = hash.finalize();
    let mut uuid: [u8; 16] = std::array::from_fn(|i| digest[i]);
    uuid[6] = uuid[6] & 0x0f | 0x80;
    uuid[8] = uuid[8] & 0x3f | 0x80;
    format!("2.25.{}", u128::from_be_bytes(uuid))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn uids_are_short_enough_and_tell_parts_apart() {
        let (a, b) = (of(&[b"ab", b"c"]), of(&[b"a", b"bc"]));
        assert_ne!(a, b);
        assert_eq!(a, of(&[b"ab", b"c"]));
        // UI holds 64 characters; the first digit of an arc is not a zero.
        assert!(a.len() <= 64 && !a[5..].starts_with('0'));
    }
}
