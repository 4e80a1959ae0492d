//! Storage of voxels in a file, and conversion to and from Hounsfield units.

use std::io::{self, Read, Write};

use crate::values::{Values, Voxels, with_room};

/// Number types that a CT may be stored in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Number {
    U8,
    I8,
    U16,
    I16,
    U32,
    I32,
    U64,
    I64,
    F32,
    F64,
}

impl Number {
    /// Bytes of one voxel.
    pub(crate) fn bytes(self) -> usize {
        match self {
            Self::U8 | Self::I8 => 1,
            Self::U16 | Self::I16 => 2,
            Self::U32 | Self::I32 | Self::F32 => 4,
            Self::U64 | Self::I64 | Self::F64 => 8,
        }
    }
}

/// Stored numbers and their conversion to Hounsfield units: `slope` x number + `intercept`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Stored {
    pub(crate) number: Number,
    pub(crate) big_endian: bool,
    pub(crate) slope: f64,
    pub(crate) intercept: f64,
}

/// Voxels converted at a time: a buffer of at most half a megabyte.
const CHUNK: usize = 1 << 16;

impl Stored {
    /// Size in bytes of a volume of `size` voxels; `None` if it exceeds 64 bits.
    pub(crate) fn bytes_of(&self, size: [usize; 3]) -> Option<u64> {
        let width = self.number.bytes() as u64;
        size.iter()
            .try_fold(width, |bytes, &n| bytes.checked_mul(n as u64))
    }

    /// Smallest and largest HU that integers of this type can express; `None` for floating-point types.
    pub(crate) fn representable_hu(&self) -> Option<[f64; 2]> {
        let [low, high] = match self.number {
            Number::U8 => [0.0, f64::from(u8::MAX)],
            Number::I8 => [f64::from(i8::MIN), f64::from(i8::MAX)],
            Number::I16 => [f64::from(i16::MIN), f64::from(i16::MAX)],
            Number::U16 => [0.0, f64::from(u16::MAX)],
            Number::I32 => [f64::from(i32::MIN), f64::from(i32::MAX)],
            Number::U32 => [0.0, f64::from(u32::MAX)],
            Number::I64 => [i64::MIN as f64, i64::MAX as f64],
            Number::U64 => [0.0, u64::MAX as f64],
            Number::F32 | Number::F64 => return None,
        }
        .map(|stored| self.slope * stored + self.intercept);
        Some([low.min(high), low.max(high)])
    }

    /// Reads `voxels` values; if the stream ends early, those that are complete.
    ///
    /// They are kept in 16 bits until one does not fit.
    pub(crate) fn read(&self, stream: &mut dyn Read, voxels: usize) -> io::Result<Voxels> {
        // A file may claim more voxels than memory can hold.
        let full = |error| io::Error::new(io::ErrorKind::OutOfMemory, error);
        let width = self.number.bytes();
        let mut read = Voxels::I16(with_room(voxels).map_err(full)?);
        let mut bytes = Vec::with_capacity(voxels.min(CHUNK) * width);
        let mut hu = Vec::with_capacity(voxels.min(CHUNK));
        loop {
            let left = voxels - read.values().len();
            let wanted = CHUNK.min(left) * width;
            bytes.clear();
            stream.take(wanted as u64).read_to_end(&mut bytes)?;
            if let (Voxels::I16(all), true) = (&mut read, self.is_whole_i16()) {
                all.extend(bytes.as_chunks().0.iter().map(|b| self.i16(*b)));
            } else {
                hu.clear();
                self.append(&bytes, &mut hu);
                if let Voxels::I16(whole) = &read
                    && !Values::F32(&hu).fit_i16()
                {
                    let mut all = with_room(voxels).map_err(full)?;
                    all.extend(whole.iter().map(|&v| f32::from(v)));
                    read = Voxels::F32(all);
                }
                match &mut read {
                    Voxels::I16(all) => all.extend(hu.iter().map(|&v| v as i16)),
                    Voxels::F32(all) => all.extend_from_slice(&hu),
                }
            }
            if left <= CHUNK || bytes.len() < wanted {
                return Ok(read);
            }
        }
    }

    /// Whether the numbers are 16-bit Hounsfield units without conversion.
    fn is_whole_i16(&self) -> bool {
        self.number == Number::I16 && self.slope == 1.0 && self.intercept == 0.0
    }

    fn i16(&self, bytes: [u8; 2]) -> i16 {
        if self.big_endian {
            i16::from_be_bytes(bytes)
        } else {
            i16::from_le_bytes(bytes)
        }
    }

    fn append(&self, bytes: &[u8], hu: &mut Vec<f32>) {
        macro_rules! decode {
            ($number:ty) => {
                if self.big_endian {
                    self.scaled(bytes, hu, |b| <$number>::from_be_bytes(b) as f64)
                } else {
                    self.scaled(bytes, hu, |b| <$number>::from_le_bytes(b) as f64)
                }
            };
        }
        match self.number {
            Number::U8 => decode!(u8),
            Number::I8 => decode!(i8),
            Number::U16 => decode!(u16),
            Number::I16 => decode!(i16),
            Number::U32 => decode!(u32),
            Number::I32 => decode!(i32),
            Number::U64 => decode!(u64),
            Number::I64 => decode!(i64),
            Number::F32 => decode!(f32),
            Number::F64 => decode!(f64),
        }
    }

    fn scaled<const N: usize>(
        &self,
        bytes: &[u8],
        hu: &mut Vec<f32>,
        number: impl Fn([u8; N]) -> f64,
    ) {
        let (slope, intercept) = (self.slope, self.intercept);
        let (numbers, _) = bytes.as_chunks::<N>();
        hu.extend(
            numbers
                .iter()
                .map(|b| (slope * number(*b) + intercept) as f32),
        );
    }
}

/// Writes values exactly and little-endian: as int16 if all fit, otherwise as float32.
pub(crate) fn write_exact(out: &mut dyn Write, hu: Values) -> io::Result<()> {
    let short = hu.fit_i16();
    let mut bytes = Vec::with_capacity(4 * CHUNK.min(hu.len()));
    for values in hu.parts(CHUNK) {
        bytes.clear();
        if short {
            bytes.extend(values.iter().flat_map(|v| (v as i16).to_le_bytes()));
        } else {
            bytes.extend(values.iter().flat_map(f32::to_le_bytes));
        }
        out.write_all(&bytes)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Smallest and largest value of every type, in both byte orders.
    #[test]
    fn every_number_type_is_understood() {
        macro_rules! check {
            ($kind:ident, $number:ty) => {
                for value in [<$number>::MIN, <$number>::MAX, 1 as $number] {
                    for big_endian in [false, true] {
                        let bytes = if big_endian {
                            value.to_be_bytes().to_vec()
                        } else {
                            value.to_le_bytes().to_vec()
                        };
                        let stored = Stored {
                            number: Number::$kind,
                            big_endian,
                            slope: 0.5,
                            intercept: -3.0,
                        };
                        assert_eq!(stored.number.bytes(), bytes.len());
                        let hu = stored.read(&mut bytes.as_slice(), 1).unwrap();
                        assert_eq!(
                            hu.values(),
                            Values::F32(&[(0.5 * value as f64 - 3.0) as f32])
                        );
                    }
                }
            };
        }
        check!(U8, u8);
        check!(I8, i8);
        check!(U16, u16);
        check!(I16, i16);
        check!(U32, u32);
        check!(I32, i32);
        check!(U64, u64);
        check!(I64, i64);
        check!(F32, f32);
        check!(F64, f64);
    }

    /// Across the borders of the chunks, and with the first value that needs more bits late.
    #[test]
    fn sixteen_bits_hold_values_until_one_does_not_fit() {
        for count in [0, 1, CHUNK, CHUNK + 1, 3 * CHUNK - 1] {
            let whole = (0..count).map(|n| (n % 3000) as f32 - 1000.0);
            let mut values = whole.collect::<Vec<_>>();
            for odd in [None, Some(0.5), Some(40_000.0)] {
                if let (Some(odd), Some(last)) = (odd, values.last_mut()) {
                    *last = odd;
                }
                let bytes = values.iter().flat_map(|v| v.to_le_bytes());
                let stored = Stored {
                    number: Number::F32,
                    big_endian: false,
                    slope: 1.0,
                    intercept: 0.0,
                };
                let bytes = bytes.collect::<Vec<_>>();
                let read = stored.read(&mut bytes.as_slice(), count).unwrap();
                let short = matches!(read, Voxels::I16(_));
                assert_eq!(short, count == 0 || odd.is_none(), "{count} {odd:?}");
                assert_eq!(read.values(), Values::F32(&values), "{count} {odd:?}");
            }
        }
    }

    proptest! {
        #[test]
        fn values_are_written_exactly(
            whole in any::<bool>(),
            values in prop::collection::vec(-40_000.0..40_000.0_f32, 0..50),
        ) {
            let values = values
                .into_iter()
                .map(|v| if whole { v.trunc() } else { v })
                .collect::<Vec<_>>();
            let mut bytes = Vec::new();
            write_exact(&mut bytes, Values::F32(&values)).unwrap();
            let stored = Stored {
                number: if Values::F32(&values).fit_i16() { Number::I16 } else { Number::F32 },
                big_endian: false,
                slope: 1.0,
                intercept: 0.0,
            };
            let back = stored.read(&mut bytes.as_slice(), values.len()).unwrap();
            prop_assert_eq!(back.values(), Values::F32(&values));
        }
    }
}
