//! The values of a volume in their storage type.

use std::borrow::Cow;
use std::ops::Range;

use rayon::prelude::*;

use crate::volume_error::VolumeError;

/// Hounsfield units, i fastest, in the type that a [`Volume`](crate::Volume) keeps them in.
///
/// CT numbers are integers in nearly every scan. Readers then keep them in 16 bits, which is exact and
/// takes half the memory. Two of these are equal if their values are.
#[derive(Debug, Clone, Copy)]
pub enum Values<'a> {
    /// Integers.
    I16(&'a [i16]),
    /// Any numbers.
    F32(&'a [f32]),
}

impl<'a> Values<'a> {
    /// Number of values.
    pub fn len(&self) -> usize {
        match self {
            Self::I16(values) => values.len(),
            Self::F32(values) => values.len(),
        }
    }

    /// Whether there are no values.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The value at an index.
    ///
    /// # Panics
    /// If the index is out of range.
    pub fn at(&self, index: usize) -> f32 {
        match self {
            Self::I16(values) => values[index].into(),
            Self::F32(values) => values[index],
        }
    }

    /// The values at a range of indices.
    ///
    /// # Panics
    /// If the range exceeds the values.
    pub fn part(&self, indices: Range<usize>) -> Self {
        match self {
            Self::I16(values) => Self::I16(&values[indices]),
            Self::F32(values) => Self::F32(&values[indices]),
        }
    }

    /// Iterates over the values.
    pub fn iter(self) -> impl ExactSizeIterator<Item = f32> + 'a {
        (0..self.len()).map(move |index| self.at(index))
    }

    /// The values as a slice, which is a copy if they are kept in 16 bits.
    pub fn to_f32(self) -> Cow<'a, [f32]> {
        match self {
            Self::I16(values) => values.iter().map(|&v| v.into()).collect(),
            Self::F32(values) => values.into(),
        }
    }

    /// Iterates over parts of `length` values, the last of which may be shorter.
    ///
    /// # Panics
    /// If `length` is 0.
    pub fn parts(self, length: usize) -> impl Iterator<Item = Self> + 'a {
        let parts = 0..self.len().div_ceil(length);
        parts.map(move |n| self.part(n * length..self.len().min((n + 1) * length)))
    }

    /// The same as a parallel iterator.
    ///
    /// # Panics
    /// If `length` is 0.
    pub fn par_parts(self, length: usize) -> impl IndexedParallelIterator<Item = Self> + 'a {
        let parts = (0..self.len().div_ceil(length)).into_par_iter();
        parts.map(move |n| self.part(n * length..self.len().min((n + 1) * length)))
    }

    /// Smallest and largest value; +∞ and −∞ if there are none.
    pub(crate) fn range(self) -> (f32, f32) {
        let widest = |a: (f32, f32), b: (f32, f32)| (a.0.min(b.0), a.1.max(b.1));
        let none = (f32::INFINITY, f32::NEG_INFINITY);
        let parts = self.par_parts(PART).map(|part| match part {
            Self::I16(values) => {
                let (low, high) = values.iter().fold((i16::MAX, i16::MIN), |(low, high), &v| {
                    (low.min(v), high.max(v))
                });
                (low.into(), high.into())
            }
            Self::F32(values) => values.iter().fold(none, |ends, &v| widest(ends, (v, v))),
        });
        parts.reduce(|| none, widest)
    }

    /// Sum of the values; exact if they are integers.
    pub(crate) fn sum(self) -> f64 {
        match self {
            // Below 2^53 in every volume that fits in memory.
            Self::I16(values) => values.par_chunks(PART).map(sum_of_whole).sum::<i64>() as f64,
            Self::F32(values) => values.iter().map(|&v| f64::from(v)).sum(),
        }
    }

    /// Whether int16 represents every value exactly.
    #[cfg(any(
        test,
        feature = "dicom",
        feature = "nifti",
        feature = "nrrd",
        feature = "metaimage"
    ))]
    pub(crate) fn fit_i16(self) -> bool {
        match self {
            Self::I16(_) => true,
            Self::F32(values) => values.iter().all(|&v| f32::from(v as i16) == v),
        }
    }
}

/// Number of values per parallel task.
const PART: usize = 1 << 18;

fn sum_of_whole(values: &[i16]) -> i64 {
    values.iter().map(|&v| i64::from(v)).sum()
}

impl PartialEq for Values<'_> {
    fn eq(&self, other: &Self) -> bool {
        match (*self, *other) {
            (Self::I16(a), Self::I16(b)) => a == b,
            (Self::F32(a), Self::F32(b)) => a == b,
            (a, b) => a.iter().eq(b.iter()),
        }
    }
}

/// An empty vector with room for `voxels` values.
///
/// # Errors
/// [`VolumeError::Memory`] where a failed allocation would otherwise abort the program.
pub fn with_room<T>(voxels: usize) -> Result<Vec<T>, VolumeError> {
    let mut values = Vec::new();
    match values.try_reserve_exact(voxels) {
        Ok(()) => Ok(values),
        Err(_) => Err(VolumeError::Memory { voxels }),
    }
}

/// `voxels` zeros to be overwritten.
pub(crate) fn zeros<T: Clone + Default>(voxels: usize) -> Result<Vec<T>, VolumeError> {
    // Reserved and released first: `vec!` cannot report failure, but gets zeroed pages without writing them.
    drop(with_room::<T>(voxels)?);
    Ok(vec![T::default(); voxels])
}

/// Values that a volume owns.
#[derive(Debug, Clone)]
pub(crate) enum Voxels {
    I16(Vec<i16>),
    F32(Vec<f32>),
}

impl Voxels {
    pub(crate) fn values(&self) -> Values<'_> {
        match self {
            Self::I16(values) => Values::I16(values),
            Self::F32(values) => Values::F32(values),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Both types give the same results, equal to the plain definitions, for any parts.
        #[test]
        fn the_type_changes_nothing(
            whole in prop::collection::vec(any::<i16>(), 1..200),
            (from, to, length) in (any::<prop::sample::Index>(), any::<prop::sample::Index>(), 1..70_usize),
        ) {
            let real = whole.iter().map(|&v| f32::from(v)).collect::<Vec<_>>();
            let (a, b) = (Values::I16(&whole), Values::F32(&real));
            prop_assert_eq!(a, b);
            prop_assert_eq!(a.to_f32(), b.to_f32());
            prop_assert_eq!(a.iter().collect::<Vec<_>>(), &real[..]);
            let ends = [from, to].map(|n| n.index(whole.len() + 1));
            let range = ends[0].min(ends[1])..ends[0].max(ends[1]);
            prop_assert_eq!(a.part(range.clone()), Values::F32(&real[range.clone()]));
            let expected = (
                f32::from(*whole.iter().min().unwrap()),
                f32::from(*whole.iter().max().unwrap()),
            );
            prop_assert_eq!([a.range(), b.range()], [expected; 2]);
            let sum = whole.iter().map(|&v| i64::from(v)).sum::<i64>() as f64;
            prop_assert_eq!([a.sum(), b.sum()], [sum; 2]);
            prop_assert!(a.fit_i16() && b.fit_i16());
            let parts = a.par_parts(length).map(|part| part.to_f32().into_owned());
            prop_assert_eq!(parts.collect::<Vec<_>>().concat(), &real[..]);
            prop_assert_eq!(a.parts(length).flat_map(Values::iter).collect::<Vec<_>>(), real);
        }
    }

    #[test]
    fn values_that_are_not_whole_or_too_large_do_not_fit() {
        for value in [0.5, 32_768.0, -32_769.0, 1e9] {
            let values = [7.0, value];
            assert!(!Values::F32(&values).fit_i16(), "{value}");
            assert_ne!(Values::F32(&values), Values::I16(&[7, value as i16]));
        }
    }
}
