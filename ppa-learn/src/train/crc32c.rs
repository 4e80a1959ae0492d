//! The checksum of TFRecord files.

/// Computes the CRC-32C (Castagnoli; polynomial 0x1EDC6F41, here bit-reversed) of `bytes`.
pub(super) fn crc32c(bytes: &[u8]) -> u32 {
    let of_byte = |crc: u32, &byte: &u8| {
        (0..8).fold(crc ^ u32::from(byte), |crc, _| {
            let carry = 0u32.wrapping_sub(crc & 1);
            (crc >> 1) ^ (0x82F6_3B78 & carry)
        })
    };
    !bytes.iter().fold(!0, of_byte)
}

#[cfg(test)]
mod tests {
    use super::crc32c;

    /// RFC 3720, appendix B.4.
    #[test]
    fn published_examples() {
        assert_eq!(crc32c(&[0; 32]), 0x8A91_36AA);
        assert_eq!(crc32c(&[0xFF; 32]), 0x62A8_AB43);
        assert_eq!(crc32c(b"123456789"), 0xE306_9283);
    }
}
