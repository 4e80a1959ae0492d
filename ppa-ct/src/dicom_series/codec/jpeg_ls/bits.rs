//! The bits of a scan, most significant first.

/// Reads bits; after the end it returns zeros and counts them.
pub(super) struct Bits<'a> {
    bytes: &'a [u8],
    /// Unread bits, at the upper end.
    cache: u64,
    cached: u32,
    /// Number of zeros returned after the end.
    missing: u32,
    /// Whether the last byte read was 0xff: the next one holds only seven bits (section A.1).
    stuffed: bool,
}

impl<'a> Bits<'a> {
    pub fn new(bytes: &'a [u8]) -> Self {
        Self {
            bytes,
            cache: 0,
            cached: 0,
            missing: 0,
            stuffed: false,
        }
    }

    /// Makes at least 49 bits available.
    fn fill(&mut self) {
        // Several bytes at once if none of the next eight announces a stuffed bit.
        if let (false, Some(next)) = (self.stuffed, self.bytes.first_chunk()) {
            let next = u64::from_be_bytes(*next);
            let (low, high) = (u64::MAX / 0xff * 0x7f, u64::MAX / 0xff * 0x80);
            let has_ff = ((next & low) + u64::MAX / 0xff) & next & high != 0;
            if !has_ff {
                let taken = (64 - self.cached) / 8;
                // The bits after them are read again later with the same result.
                self.cache |= next >> self.cached;
                self.cached += 8 * taken;
                self.bytes = &self.bytes[taken as usize..];
                return;
            }
        }
        while self.cached <= 48 {
            match self.bytes {
                // A byte above 0x7f after 0xff forms a marker: the scan has ended.
                [byte, rest @ ..] if !(self.stuffed && *byte > 0x7f) => {
                    let width = if self.stuffed { 7 } else { 8 };
                    self.cache |= u64::from(*byte) << (64 - width - self.cached);
                    self.cached += width;
                    self.stuffed = *byte == 0xff;
                    self.bytes = rest;
                }
                _ => {
                    self.cached += 8;
                    self.missing += 8;
                }
            }
        }
    }

    /// The next `count` bits, at most 32, as a number.
    #[inline]
    pub fn take(&mut self, count: u32) -> u32 {
        if self.cached < count {
            self.fill();
        }
        // Two shifts: a single shift by all 64 bits is not allowed.
        let bits = (self.cache >> 1 >> (63 - count)) as u32;
        self.cache <<= count;
        self.cached -= count;
        bits
    }

    /// Counts the zeros before the next one bit and consumes all of them; `None` for more than `most`.
    #[inline]
    pub fn zeros(&mut self, most: u32) -> Option<u32> {
        let mut before = 0;
        let mut zeros = self.cache.leading_zeros();
        // One fill holds at least 49 bits, a code up to 55 zeros.
        while zeros >= self.cached && before + self.cached <= most {
            before += self.cached;
            (self.cache, self.cached) = (0, 0);
            self.fill();
            zeros = self.cache.leading_zeros();
        }
        if before + zeros > most {
            return None;
        }
        self.cache = self.cache << zeros << 1;
        self.cached -= zeros + 1;
        Some(before + zeros)
    }

    /// Whether more bits were read than exist.
    pub fn overdrawn(&self) -> bool {
        self.missing > self.cached
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Compared with a list of all bits, whether bytes are read one by one or eight at a time.
        #[test]
        fn stuffed_bits_are_left_out(
            bytes in prop::collection::vec(prop_oneof![4 => any::<u8>(), 1 => Just(0xff)], 0..80),
            counts in prop::collection::vec(0..64_u32, 1..60),
        ) {
            let mut all = Vec::new();
            let mut stuffed = false;
            for &byte in &bytes {
                if stuffed && byte > 0x7f {
                    break;
                }
                let width = if stuffed { 7 } else { 8 };
                all.extend((0..width).rev().map(|bit| u32::from(byte) >> bit & 1));
                stuffed = byte == 0xff;
            }
            let (mut bits, mut at) = (Bits::new(&bytes), 0);
            for (n, count) in counts.into_iter().enumerate() {
                let next = |at: usize| all.get(at).copied().unwrap_or(0);
                if n % 3 == 0 {
                    let zeros = (0..).take_while(|&n| n <= count && next(at + n as usize) == 0);
                    let zeros = zeros.count() as u32;
                    prop_assert_eq!(bits.zeros(count), (zeros <= count).then_some(zeros));
                    if zeros > count {
                        break;
                    }
                    at += zeros as usize + 1;
                } else {
                    let count = count % 33;
                    let number = (0..count as usize).fold(0, |number, n| number << 1 | next(at + n));
                    prop_assert_eq!(bits.take(count), number);
                    at += count as usize;
                }
                prop_assert_eq!(bits.overdrawn(), at > all.len());
            }
        }
    }

    /// The longest code of 16 bits with NEAR = 255, at any start, followed by 0xff, which is read byte by byte.
    #[test]
    fn a_code_may_begin_with_55_zeros() {
        for (lead, zeros) in (0..33).flat_map(|lead| (0..=55).map(move |zeros| (lead, zeros))) {
            let code = [vec![1; lead], vec![0; zeros], vec![1; 40]].concat();
            let (mut bytes, mut rest) = (Vec::new(), code.as_slice());
            while !rest.is_empty() {
                let width = if bytes.last() == Some(&0xff) { 7 } else { 8 };
                let (byte, tail) = rest.split_at(width.min(rest.len()));
                let value = byte.iter().fold(0, |value, bit| value << 1 | bit);
                bytes.push(value << (width - byte.len()));
                rest = tail;
            }
            let mut bits = Bits::new(&bytes);
            assert_eq!(bits.take(lead as u32), ((1_u64 << lead) - 1) as u32);
            assert_eq!(bits.zeros(55), Some(zeros as u32), "{zeros} behind {lead}");
            assert_eq!(bits.take(20), (1 << 20) - 1);
        }
    }
}
