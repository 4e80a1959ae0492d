//! Stored numbers: where they sit in their containers, which of them are padding, and how they become HU.

use dicom_dictionary_std::tags;

use super::attributes::Attributes;
use crate::error::ReadError;

/// HU of padding that does not read as air by itself.
const AIR_HU: f32 = -1000.0;
/// Values that read as air: noise and scanners that end their scale at -1024.
const READS_AS_AIR: std::ops::RangeInclusive<f32> = -1100.0..=-900.0;

/// How a stored value sits in its container (DICOM PS3.5, section 8.1.1), and which values are no measurement.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct StoredFormat {
    /// 8, 16 or 32.
    pub bits_allocated: u32,
    /// Bits that carry the value.
    pub bits_stored: u32,
    /// Position of the topmost of them.
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
                "8, 16 or 32 with the stored bits inside",
            ));
        }
        // Padding is written as a value, not as a container; files disagree on its sign.
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

    /// Bytes of a container.
    pub fn bytes(&self) -> usize {
        self.bits_allocated as usize / 8
    }

    /// Fills `hu` from little-endian containers; returns how many pixels were padding and became air.
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
        // f32 holds whole numbers up to 2^24 exactly, and is twice as fast.
        let whole = |v: f64| v.fract() == 0.0 && v.abs() < 256.0 * 256.0;
        if N < 4 && whole(intercept) && slope == 1.0 {
            let intercept = intercept as f32;
            for (hu, container) in hu.iter_mut().zip(containers) {
                *hu = value(container) as i32 as f32 + intercept;
            }
        } else {
            for (hu, container) in hu.iter_mut().zip(containers) {
                *hu = (slope * value(container) as f64 + intercept) as f32;
            }
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
        let dropped_above = 31 - self.high_bit;
        let unused = 32 - self.bits_stored;
        if self.signed {
            i64::from((container << dropped_above).cast_signed() >> unused)
        } else {
            i64::from((container << dropped_above) >> unused)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Whatever sits in the unused bits, the value that was put in comes out.
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
        let mut hu = [0.0; 4];
        assert_eq!(format.read_hu(&stored, [1.0, -1024.0], &mut hu), 2);
        assert_eq!(hu, [-1000.0, -1000.0, -3013.0, -984.0]);
        // Air already: what other readers give is kept.
        assert_eq!(format.read_hu(&stored, [1.0, 976.0], &mut hu), 0);
        assert_eq!(hu, [-1024.0, -1014.0, -1013.0, 1016.0]);
    }
}
