//! RLE lossless: byte planes packed with PackBits (DICOM PS3.5, annex G).

/// Length of the header of 16 numbers: the number of segments and their offsets.
const HEADER_BYTES: usize = 64;

/// Unpacks one grey frame into little-endian `values` of `width` bytes; `None` if it is damaged.
///
/// Segments hold the most significant byte of all pixels first.
pub(super) fn unpack(packed: &[u8], width: usize, values: &mut [u8]) -> Option<()> {
    let header = packed.get(..HEADER_BYTES)?;
    let (numbers, _) = header.as_chunks::<4>();
    let number = |n: usize| u32::from_le_bytes(numbers[n]) as usize;
    if number(0) != width {
        return None;
    }
    for plane in 0..width {
        let end = if plane + 1 < width {
            number(plane + 2)
        } else {
            packed.len()
        };
        let segment = packed.get(number(plane + 1)..end)?;
        let places = values.iter_mut().skip(width - 1 - plane).step_by(width);
        unpack_segment(segment, places)?;
    }
    Some(())
}

/// Fills all `places`; the rest of the segment is padding.
fn unpack_segment<'a>(
    segment: &[u8],
    mut places: impl ExactSizeIterator<Item = &'a mut u8>,
) -> Option<()> {
    let mut rest = segment;
    while places.len() > 0 {
        let (&control, tail) = rest.split_first()?;
        match control.cast_signed() {
            // A run of literal bytes.
            literal @ 0.. => {
                let (bytes, tail) = tail.split_at_checked(literal as usize + 1)?;
                for (place, byte) in places.by_ref().take(bytes.len()).zip(bytes) {
                    *place = *byte;
                }
                rest = tail;
            }
            i8::MIN => rest = tail,
            repeat => {
                let (&byte, tail) = tail.split_first()?;
                let run = 1 + usize::from(repeat.unsigned_abs());
                places.by_ref().take(run).for_each(|place| *place = byte);
                rest = tail;
            }
        }
    }
    Some(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Packs bytes in the given kinds of runs, with no-op codes in between.
    fn pack(bytes: &[u8], runs: &[usize]) -> Vec<u8> {
        let (mut packed, mut rest) = (Vec::new(), bytes);
        for run in runs.iter().cycle() {
            if rest.is_empty() {
                return packed;
            }
            let equal = rest.iter().take_while(|b| **b == rest[0]).count().min(128);
            let taken = if equal > 1 {
                packed.extend([(1 - equal as i32) as i8 as u8, rest[0]]);
                equal
            } else {
                let run = (*run).min(rest.len());
                packed.push(run as u8 - 1);
                packed.extend(&rest[..run]);
                run
            };
            packed.push(0x80);
            rest = &rest[taken..];
        }
        packed
    }

    fn frame(values: &[u16], runs: &[usize]) -> Vec<u8> {
        let planes = [8, 0].map(|shift| {
            let plane = values.iter().map(|v| (v >> shift) as u8);
            pack(&plane.collect::<Vec<_>>(), runs)
        });
        let starts = [2, HEADER_BYTES, HEADER_BYTES + planes[0].len()];
        let mut packed = starts
            .iter()
            .flat_map(|&n| (n as u32).to_le_bytes())
            .collect::<Vec<_>>();
        packed.resize(HEADER_BYTES, 0);
        packed.extend(planes.concat());
        packed
    }

    proptest! {
        #[test]
        fn packed_values_come_back(
            values in prop::collection::vec(prop_oneof![Just(7_u16), any::<u16>()], 1..300),
            runs in prop::collection::vec(1..129_usize, 1..5),
        ) {
            let packed = frame(&values, &runs);
            let bytes = values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<_>>();
            let mut unpacked = vec![0; bytes.len()];
            prop_assert_eq!(unpack(&packed, 2, &mut unpacked), Some(()));
            prop_assert_eq!(unpacked, bytes);
        }

        #[test]
        fn damaged_frames_never_panic(
            values in prop::collection::vec(any::<u16>(), 1..50),
            damage in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..6),
            keep in any::<prop::sample::Index>(),
        ) {
            let mut packed = frame(&values, &[5]);
            for (at, byte) in damage {
                let at = at.index(packed.len());
                packed[at] = byte;
            }
            packed.truncate(keep.index(packed.len() + 1));
            unpack(&packed, 2, &mut vec![0; 2 * values.len()]);
        }
    }
}
