//! Inside voxels, one bit each.

use super::field::{Field, Sample};

/// Bits of neighbouring slices of a field, 64 voxels of a row to a word; the bits after the end of a row
/// are 0.
pub struct InsideBits<T> {
    first_inside: T,
    rows: usize,
    words: usize,
    /// The last voxel of a row, in its word.
    last: u64,
    first_slice: usize,
    slices: Vec<SliceBits>,
}

/// Bits of one slice.
struct SliceBits {
    bits: Vec<u64>,
    /// By row: whether a sample equals the iso value.
    at_iso: Vec<bool>,
}

impl SliceBits {
    fn of<T: Sample>(field: &Field<T>, k: usize, first_inside: T) -> Self {
        let [nx, rows, _] = field.size();
        let iso_occurs = first_inside.into() == field.iso();
        let mut bits = Vec::with_capacity(nx.div_ceil(64) * rows);
        let mut at_iso = Vec::with_capacity(rows);
        for j in 0..rows {
            let row = field.row(j, k);
            let (whole, rest) = row.as_chunks::<64>();
            bits.extend(whole.iter().map(|chunk| pack(chunk, first_inside)));
            if !rest.is_empty() {
                let rest = rest.iter().enumerate();
                bits.push(rest.fold(0, |word, (bit, &hu)| {
                    word | u64::from(hu >= first_inside) << bit
                }));
            }
            // Without early exit, so that the compiler compares many at once.
            let equal = |found: bool, &hu: &T| found | (hu == first_inside);
            at_iso.push(iso_occurs && row.iter().fold(false, equal));
        }
        Self { bits, at_iso }
    }
}

impl<T: Sample> InsideBits<T> {
    /// For a field whose samples are inside from `first_inside` upwards; without slices yet.
    pub fn new(field: &Field<T>, first_inside: T, first_slice: usize) -> Self {
        let [nx, rows, _] = field.size();
        Self {
            first_inside,
            rows,
            words: nx.div_ceil(64),
            last: 1 << ((nx - 1) % 64),
            first_slice,
            slices: Vec::new(),
        }
    }

    /// Adds the slices before `end`.
    pub fn extend_to(&mut self, end: usize, field: &Field<T>) {
        for k in self.first_slice + self.slices.len()..end {
            (self.slices).push(SliceBits::of(field, k, self.first_inside));
        }
    }

    /// Words per row.
    pub fn words(&self) -> usize {
        self.words
    }

    /// Voxels with a neighbour to the right.
    pub fn cells(&self, word: usize) -> u64 {
        if word + 1 == self.words {
            self.last - 1
        } else {
            u64::MAX
        }
    }

    /// Row j of slice k.
    pub fn row(&self, j: usize, k: usize) -> &[u64] {
        &self.slices[k - self.first_slice].bits[self.words * j..self.words * (j + 1)]
    }

    /// Whether a sample of row j of slice k equals the iso value.
    pub fn at_iso(&self, j: usize, k: usize) -> bool {
        self.slices[k - self.first_slice].at_iso[j]
    }

    /// Crossed edges within slice k.
    pub fn crossings(&self, k: usize) -> usize {
        let rows = (0..self.rows).flat_map(|j| {
            let (row, next) = (self.row(j, k), self.row((j + 1).min(self.rows - 1), k));
            (0..self.words).map(move |word| {
                let along = [self.crossed_along_x(row, word), row[word] ^ next[word]];
                along.map(|crossed| crossed.count_ones() as usize)
            })
        });
        rows.map(|[x, y]| x + y).sum()
    }

    /// Pairs of neighbours in a row of which one is inside, as a bit at the left one.
    pub fn crossed_along_x(&self, row: &[u64], word: usize) -> u64 {
        (row[word] ^ right_of(row, word)) & self.cells(word)
    }

    /// Inside voxels with an outside neighbour on any of the six sides.
    pub fn at_surface(&self, j: usize, k: usize, word: usize) -> u64 {
        let row = self.row(j, k);
        let mut inner = if word + 1 == self.words {
            right_of(row, word) | self.last
        } else {
            right_of(row, word)
        };
        inner &= row[word] << 1
            | match word {
                0 => 1,
                _ => row[word - 1] >> 63,
            };
        for beside in [j.wrapping_sub(1), j + 1] {
            if beside < self.rows {
                inner &= self.row(beside, k)[word];
            }
        }
        for slice in [k.wrapping_sub(1), k + 1] {
            if (self.first_slice..self.first_slice + self.slices.len()).contains(&slice) {
                inner &= self.row(j, slice)[word];
            }
        }
        row[word] & !inner
    }
}

/// The bits of the right-hand neighbours; 0 after the end of the row.
pub fn right_of(row: &[u64], word: usize) -> u64 {
    row[word] >> 1 | row.get(word + 1).map_or(0, |next| next << 63)
}

/// The positions of the ones of a word.
pub fn ones(mut word: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        if word == 0 {
            return None;
        }
        let bit = word.trailing_zeros() as usize;
        word &= word - 1;
        Some(bit)
    })
}

/// Compares samples into bytes, which the compiler vectorises, then gathers the bits of the bytes:
/// the product moves bit 8 i to 56 + i for i = 0 to 7, and no two of the others meet.
fn pack<T: Sample>(chunk: &[T; 64], first_inside: T) -> u64 {
    const GATHER: u64 = 0x0102_0408_1020_4080;
    let mut bytes = [0_u8; 64];
    for (byte, &hu) in bytes.iter_mut().zip(chunk) {
        *byte = u8::from(hu >= first_inside);
    }
    let (groups, _) = bytes.as_chunks::<8>();
    groups.iter().rev().fold(0, |word, &group| {
        word << 8 | u64::from_le_bytes(group).wrapping_mul(GATHER) >> 56
    })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// For both types of samples, against the definition.
        #[test]
        fn bits_are_those_of_the_definition(
            hu in prop::collection::vec(-3..3_i16, 5 * 3 * 3 * 29),
            nx in 1..145_usize,
            iso in -3.5..3.5_f32,
        ) {
            let size = [nx, 3, 3];
            let hu = &hu[..9 * nx];
            let float: Vec<f32> = hu.iter().map(|&v| v.into()).collect();
            let whole = Field::new(hu, size, [0.0; 3], iso);
            let exact = Field::new(&float, size, [0.0; 3], iso);
            let mut bits = InsideBits::new(&whole, i16::first_inside(iso).unwrap(), 0);
            let mut of_floats = InsideBits::new(&exact, iso, 0);
            bits.extend_to(3, &whole);
            of_floats.extend_to(3, &exact);
            for (slice, of_floats) in bits.slices.iter().zip(&of_floats.slices) {
                prop_assert_eq!(&slice.bits, &of_floats.bits);
                prop_assert_eq!(&slice.at_iso, &of_floats.at_iso);
            }
            let inside = |i: usize, j: usize, k: usize| float[i + nx * (j + 3 * k)] >= iso;
            for (i, j, k) in (0..9 * nx).map(|at| (at % nx, at / nx % 3, at / nx / 3)) {
                let bit = |word: u64| word >> (i % 64) & 1 == 1;
                let row = bits.row(j, k);
                prop_assert_eq!(bit(row[i / 64]), inside(i, j, k));
                prop_assert_eq!(
                    bit(bits.crossed_along_x(row, i / 64)),
                    i + 1 < nx && inside(i, j, k) != inside(i + 1, j, k)
                );
                let outside = |di: isize, dj: isize, dk: isize| {
                    let at = [(i, di, nx), (j, dj, 3), (k, dk, 3)]
                        .map(|(at, step, n)| at.checked_add_signed(step).filter(|&at| at < n));
                    matches!(at, [Some(i), Some(j), Some(k)] if !inside(i, j, k))
                };
                let around = [(1, 0, 0), (0, 1, 0), (0, 0, 1)].into_iter().any(|(x, y, z)| {
                    outside(x, y, z) || outside(-x, -y, -z)
                });
                prop_assert_eq!(bit(bits.at_surface(j, k, i / 64)), inside(i, j, k) && around);
            }
        }
    }

    #[test]
    fn sixteen_bits_end_where_they_end() {
        assert_eq!(i16::first_inside(-499.5), Some(-499));
        assert_eq!(i16::first_inside(-1e9), Some(i16::MIN));
        assert_eq!(i16::first_inside(32767.5), None);
    }
}
