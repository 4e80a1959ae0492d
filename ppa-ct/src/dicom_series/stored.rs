//! Stored values: bit layout, padding, conversion to HU.

use dicom_dictionary_std::tags;

use super::attributes::Attributes;
use crate::error::ReadError;

/// HU assigned to padding that does not read as air by itself.
const AIR_HU: f32 = -1000.0;
/// Values that read as air: includes noise and scanners whose scale ends at -1024.
const READS_AS_AIR: std::ops::RangeInclusive<f32> = -1100.0..=-900.0;

/// Layout of a stored value in its container (DICOM PS3.5, section 8.1.1), and which values are not measurements.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct StoredFormat {
    /// 8, 16 or 32.
    pub bits_allocated: u32,
    /// Bits that carry the value.
    pub bits_stored: u32,
    /// Position of the most significant stored bit.
    pub high_bit: u32,
    pub signed: bool,
    /// Smallest and largest stored value that pads the image (PS3.3, section C.7.5.1.1.2).
    pub padding: Option<(i64, i64)>,
}

impl StoredFormat {
    pub fn of(attributes: &Attributes) -> Result<Self, ReadError> {
        let mut format = Self {
            bits_allocated: attributes
                .needed_word(tags::BITS_ALLOCATED, "BitsAllocated")?
                .into(),
            bits_stored: attributes
                .needed_word(tags::BITS_STORED, "BitsStored")?
                .into(),
            high_bit: attributes.needed_word(tags::HIGH_BIT, "HighBit")?.into(),
            signed: attributes.needed_word(tags::PIXEL_REPRESENTATION, "PixelRepresentation")? == 1,
            padding: None,
        };
        let fits = (1..=format.bits_allocated).contains(&format.bits_stored)
            && (format.bits_stored - 1..format.bits_allocated).contains(&format.high_bit);
        if !matches!(format.bits_allocated, 8 | 16 | 32) || !fits {
            return Err(attributes.bad(
                "BitsAllocated",
                format!(
                    "{} with {} bits stored up to bit {}",
                    format.bits_allocated, format.bits_stored, format.high_bit
                ),
                "8, 16 or 32, with the stored bits within them",
            ));
        }
        // Padding is stated as a value, not as a container; files disagree on its sign.
        let value = |word: u16| match format.signed {
            true => i64::from(word.cast_signed()),
            false => i64::from(word),
        };
        if let Some(first) = attributes.word(tags::PIXEL_PADDING_VALUE) {
            let last = attributes
                .word(tags::PIXEL_PADDING_RANGE_LIMIT)
                .unwrap_or(first);
            let [a, b] = [first, last].map(value);
            format.padding = Some((a.min(b), a.max(b)));
        }
        Ok(format)
    }

    /// Size of a container in bytes.
    pub fn bytes(&self) -> usize {
        self.bits_allocated as usize / 8
    }

    /// Fills `hu` from little-endian containers with whole numbers; returns the number of padding pixels set to air, or `None`
    /// if the values are not whole or do not fit in 16 bits.
    ///
    /// `hu` and `containers` hold the same number of pixels.
    pub fn read_whole(
        &self,
        containers: &[u8],
        rescale: [f64; 2],
        hu: &mut [i16],
    ) -> Option<usize> {
        let intercept = whole_intercept(rescale)?;
        let word = |b: &[u8; 2]| u16::from_le_bytes(*b).into();
        match self.bytes() {
            1 => self.fill_whole(containers.iter().map(|&b| b.into()), intercept, hu),
            2 => self.fill_whole(containers.as_chunks().0.iter().map(word), intercept, hu),
            _ => None,
        }
    }

    fn fill_whole(
        &self,
        containers: impl Iterator<Item = u32>,
        intercept: i32,
        hu: &mut [i16],
    ) -> Option<usize> {
        let (low, high) = self.padding.unwrap_or((1, 0));
        let (low, high) = (low as i32, high as i32);
        let [first_air, last_air] = [READS_AS_AIR.start(), READS_AS_AIR.end()].map(|&v| v as i32);
        let put = |(hu, stored): (&mut i16, i32)| {
            let value = stored + intercept;
            // Branch-free so that it vectorises.
            let pads =
                (low <= stored) & (stored <= high) & !((first_air <= value) & (value <= last_air));
            let value = if pads { AIR_HU as i32 } else { value };
            *hu = value as i16;
            (u32::from(pads), i32::from(*hu) ^ value)
        };
        let sum = |(padded, lost), (pads, loses)| (padded + pads, lost | loses);
        let (up, down) = self.shifts();
        let (padded, lost) = if self.signed {
            let stored = containers.map(|c| (c << up).cast_signed() >> down);
            hu.iter_mut().zip(stored).map(put).fold((0, 0), sum)
        } else {
            let stored = containers.map(|c| ((c << up) >> down).cast_signed());
            hu.iter_mut().zip(stored).map(put).fold((0, 0), sum)
        };
        (lost == 0).then_some(padded as usize)
    }

    /// Fills `hu` from little-endian containers; returns the number of padding pixels set to air.
    ///
    /// `hu` and `containers` hold the same number of pixels.
    pub fn read_hu(&self, containers: &[u8], rescale: [f64; 2], hu: &mut [f32]) -> usize {
        match self.bytes() {
            1 => self.fill(containers.as_chunks::<1>().0, |[b]| b.into(), rescale, hu),
            2 => self.fill(
                containers.as_chunks::<2>().0,
                |b| u16::from_le_bytes(b).into(),
                rescale,
                hu,
            ),
            _ => self.fill(
                containers.as_chunks::<4>().0,
                u32::from_le_bytes,
                rescale,
                hu,
            ),
        }
    }

    fn fill<const N: usize>(
        &self,
        containers: &[[u8; N]],
        number: impl Fn([u8; N]) -> u32,
        [slope, intercept]: [f64; 2],
        hu: &mut [f32],
    ) -> usize {
        let value = |container: &[u8; N]| self.value(number(*container));
        for (hu, container) in hu.iter_mut().zip(containers) {
            *hu = (slope * value(container) as f64 + intercept) as f32;
        }
        let Some((low, high)) = self.padding else {
            return 0;
        };
        let mut padded = 0;
        for (hu, container) in hu.iter_mut().zip(containers) {
            if (low..=high).contains(&value(container)) && !READS_AS_AIR.contains(hu) {
                *hu = AIR_HU;
                padded += 1;
            }
        }
        padded
    }

    /// The number in a container: bits outside the stored ones are dropped, the sign extended.
    #[inline]
    fn value(&self, container: u32) -> i64 {
        let (up, down) = self.shifts();
        if self.signed {
            i64::from((container << up).cast_signed() >> down)
        } else {
            i64::from((container << up) >> down)
        }
    }

    /// Shifts of a 32-bit container, left and then right, that leave the stored bits.
    fn shifts(&self) -> (u32, u32) {
        (31 - self.high_bit, 32 - self.bits_stored)
    }
}

/// The intercept, if stored numbers and HU differ only by a whole number.
pub(super) fn whole_intercept([slope, intercept]: [f64; 2]) -> Option<i32> {
    let small = intercept.abs() < 256.0 * 256.0;
    (slope == 1.0 && intercept.fract() == 0.0 && small).then_some(intercept as i32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// The stored value is recovered whatever the unused bits are.
        #[test]
        fn stored_value_survives_its_container(
            (allocated, stored, high) in prop::sample::select(vec![8_u32, 16, 32])
                .prop_flat_map(|a| (Just(a), 2..=a))
                .prop_flat_map(|(a, s)| (Just(a), Just(s), s - 1..a)),
            bits in any::<u32>(),
            noise in any::<u32>(),
            signed in any::<bool>(),
            rescale in prop_oneof![Just([1.0, -1024.0]), Just([0.25, 3.5])],
        ) {
            let mask = u32::MAX >> (32 - stored);
            let low = high + 1 - stored;
            let container = ((bits & mask) << low) | (noise & !(mask << low));
            let value = i64::from(bits & mask);
            let negative = signed && value >= 1 << (stored - 1);
            let expected = if negative { value - (1 << stored) } else { value };
            let format = StoredFormat {
                bits_allocated: allocated, bits_stored: stored, high_bit: high, signed, padding: None,
            };
            prop_assert_eq!(format.value(container), expected);
            let mut hu = [0.0];
            format.read_hu(&container.to_le_bytes()[..format.bytes()], rescale, &mut hu);
            prop_assert_eq!(hu[0], (rescale[0] * expected as f64 + rescale[1]) as f32);

            // The same in 16 bits, if it fits.
            let mut whole = [0];
            let containers = &container.to_le_bytes()[..format.bytes()];
            let read = format.read_whole(containers, rescale, &mut whole);
            let fits = allocated < 32 && rescale[0] == 1.0 && f32::from(hu[0] as i16) == hu[0];
            prop_assert_eq!(read, fits.then_some(0));
            prop_assert!(!fits || f32::from(whole[0]) == hu[0]);
        }
    }

    #[test]
    fn padding_becomes_air_unless_it_reads_as_air() {
        let format = StoredFormat {
            bits_allocated: 16,
            bits_stored: 16,
            high_bit: 15,
            signed: true,
            padding: Some((-2000, -1990)),
        };
        let stored = [-2000_i16, -1990, -1989, 40].map(i16::to_le_bytes).concat();
        for (intercept, padded, expected) in [
            (-1024, 2, [-1000, -1000, -3013, -984]),
            // Already air: the value that other readers give is kept.
            (976, 0, [-1024, -1014, -1013, 1016]),
            // -32770 is padding and need not fit in 16 bits.
            (-30_770, 2, [-1000, -1000, -32_759, -30_730]),
        ] {
            let (mut hu, mut whole) = ([0.0; 4], [0; 4]);
            let rescale = [1.0, f64::from(intercept)];
            assert_eq!(format.read_hu(&stored, rescale, &mut hu), padded);
            assert_eq!(hu, expected.map(|v| v as f32));
            let fits = expected.iter().all(|v| i16::try_from(*v).is_ok());
            let read = format.read_whole(&stored, rescale, &mut whole);
            assert_eq!(read, fits.then_some(padded));
            assert!(!fits || whole.map(i32::from) == expected);
        }
    }
}
