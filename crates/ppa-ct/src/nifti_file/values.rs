//! Stored NIfTI values become Hounsfield units.

use nifti::{Endianness, NiftiHeader};
use rayon::prelude::*;

/// How voxels are stored.
pub(super) struct Stored {
    kind: Kind,
    big_endian: bool,
    slope: f64,
    intercept: f64,
}

/// Number types a CT may come in (`datatype` codes of `nifti1.h`).
#[derive(Clone, Copy)]
enum Kind {
    U8,
    I8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

impl Kind {
    fn bytes(self) -> usize {
        match self {
            Self::U8 | Self::I8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }
}

impl Stored {
    pub(super) fn of(header: &NiftiHeader) -> Result<Self, String> {
        let kind = match header.datatype {
            2 => Kind::U8,
            4 => Kind::I16,
            8 => Kind::I32,
            16 => Kind::F32,
            64 => Kind::F64,
            256 => Kind::I8,
            512 => Kind::U16,
            768 => Kind::U32,
            1024 => Kind::I64,
            1280 => Kind::U64,
            code => {
                return Err(format!(
                    "voxels of datatype code {code}, expected integers or real numbers"
                ));
            }
        };
        // A slope of 0 or NaN means that values are stored as they are.
        let slope = f64::from(header.scl_slope);
        let scaled = slope.is_finite() && slope != 0.0;
        let intercept = f64::from(header.scl_inter);
        Ok(Self {
            kind,
            big_endian: header.endianness == Endianness::Big,
            slope: if scaled { slope } else { 1.0 },
            intercept: if scaled && intercept.is_finite() {
                intercept
            } else {
                0.0
            },
        })
    }

    /// Smallest and largest HU that whole numbers of this type can express; `None` for real ones.
    pub(super) fn representable_hu(&self) -> Option<[f64; 2]> {
        let [low, high] = match self.kind {
            Kind::U8 => [0.0, f64::from(u8::MAX)],
            Kind::I8 => [f64::from(i8::MIN), f64::from(i8::MAX)],
            Kind::I16 => [f64::from(i16::MIN), f64::from(i16::MAX)],
            Kind::U16 => [0.0, f64::from(u16::MAX)],
            Kind::I32 => [f64::from(i32::MIN), f64::from(i32::MAX)],
            Kind::U32 => [0.0, f64::from(u32::MAX)],
            Kind::I64 => [i64::MIN as f64, i64::MAX as f64],
            Kind::U64 => [0.0, u64::MAX as f64],
            Kind::F32 | Kind::F64 => return None,
        }
        .map(|stored| self.slope * stored + self.intercept);
        Some([low.min(high), low.max(high)])
    }

    /// Bytes that a volume of `size` voxels takes.
    pub(super) fn bytes_for(&self, size: [usize; 3]) -> u64 {
        size.iter().map(|&n| n as u64).product::<u64>() * self.kind.bytes() as u64
    }

    pub(super) fn to_hu(&self, bytes: &[u8]) -> Vec<f32> {
        macro_rules! decode {
            ($number:ty) => {
                self.scaled(bytes, |big_endian, b| {
                    if big_endian {
                        <$number>::from_be_bytes(b) as f64
                    } else {
                        <$number>::from_le_bytes(b) as f64
                    }
                })
            };
        }
        match self.kind {
            Kind::U8 => decode!(u8),
            Kind::I8 => decode!(i8),
            Kind::I16 => decode!(i16),
            Kind::U16 => decode!(u16),
            Kind::I32 => decode!(i32),
            Kind::U32 => decode!(u32),
            Kind::I64 => decode!(i64),
            Kind::U64 => decode!(u64),
            Kind::F32 => decode!(f32),
            Kind::F64 => decode!(f64),
        }
    }

    fn scaled<const N: usize>(
        &self,
        bytes: &[u8],
        number: impl Fn(bool, [u8; N]) -> f64 + Sync,
    ) -> Vec<f32> {
        let (slope, intercept, big_endian) = (self.slope, self.intercept, self.big_endian);
        let (numbers, _) = bytes.as_chunks::<N>();
        numbers
            .par_iter()
            .with_min_len(1 << 16)
            .map(|b| (slope * number(big_endian, *b) + intercept) as f32)
            .collect()
    }
}
