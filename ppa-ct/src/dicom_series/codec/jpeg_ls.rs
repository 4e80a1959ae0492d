//! JPEG-LS, lossless and near-lossless, of one component (ISO/IEC 14495-1, the same as ITU-T T.87).
//!
//! No maintained pure-Rust crate decodes it. Reading a series takes 0.6 times the processor time of SimpleITK (bench `dicom`,
//! docs/performance.md).

mod bits;
mod context;
mod scan;

use super::{CodecError, contain, expect_frame, marker, segment};
use crate::dicom_series::header::Image;
use crate::values::with_room;
use scan::{Coding, Thresholds};

pub(super) fn unpack(packed: &[u8], image: &Image) -> Result<Vec<u8>, CodecError> {
    let damaged = |what: &str| CodecError::Damaged(what.to_owned());
    let mut rest = packed
        .strip_prefix(&[0xff, 0xd8])
        .ok_or_else(|| damaged("no start-of-image marker"))?;
    let mut bits = None;
    let mut thresholds = None;
    loop {
        let marker = marker(&mut rest).ok_or_else(|| damaged("a marker is missing"))?;
        let segment = segment(&mut rest).ok_or_else(|| damaged("a segment is truncated"))?;
        match (marker, segment) {
            // Start of a frame (section C.2.2).
            (0xf7, [depth, y1, y0, x1, x0, components, ..]) => {
                let size = [[*x1, *x0], [*y1, *y0]].map(|v| u16::from_be_bytes(v).into());
                expect_frame(size, (*components).into(), u32::from(*depth), image)?;
                if !(2..=16).contains(depth) {
                    return Err(CodecError::Unexpected {
                        found: format!("samples of {depth} bits"),
                        expected: "2 to 16".to_owned(),
                    });
                }
                bits = Some(u32::from(*depth));
            }
            // Coding parameters (section C.2.4.1.1); zeros stand for the defaults.
            (0xf8, [1, parameters @ ..]) if parameters.len() == 10 => {
                let (numbers, _) = parameters.as_chunks::<2>();
                let number = |n: usize| i32::from(u16::from_be_bytes(numbers[n]));
                thresholds = Some(Thresholds {
                    largest: number(0),
                    t: [number(1), number(2), number(3)],
                    reset: number(4),
                });
            }
            (0xf8, [kind, ..]) => {
                return Err(CodecError::Unexpected {
                    found: format!("parameters of type {kind}"),
                    expected: "type 1".to_owned(),
                });
            }
            (0xdd, interval) if interval.iter().any(|b| *b > 0) => {
                return Err(CodecError::Unexpected {
                    found: "restart markers".to_owned(),
                    expected: "none".to_owned(),
                });
            }
            // Start of the scan (section C.2.3).
            (0xda, [1, _, mapping, near, _, transform]) => {
                let bits = bits.ok_or_else(|| damaged("a scan without a frame"))?;
                if *mapping != 0 || *transform != 0 {
                    return Err(CodecError::Unexpected {
                        found: "a mapping table or a point transform".to_owned(),
                        expected: "neither".to_owned(),
                    });
                }
                let coding = Coding::new(bits, i32::from(*near), thresholds)
                    .ok_or_else(|| damaged("invalid coding parameters"))?;
                let room = with_room(image.pixels())?;
                let samples = coding
                    .decode(rest, image.columns, image.rows, room)
                    .ok_or_else(|| damaged("it ends early or contains an invalid code"))?;
                return contain(samples.iter().map(|&v| v.into()), image);
            }
            (0xe0..=0xef | 0xfe | 0xdd, _) => {}
            _ => return Err(damaged("an unknown marker")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dicom_series::codec::FOUR_BY_FOUR;

    /// The worked example of the standard: section H.3, figure H.1.
    #[test]
    fn the_example_of_the_standard_is_decoded() {
        const STREAM: &str = "ffd8fff7000b080004000401011100ffda0008010100000000\
            c000006c80208e01c00000574000006ee6000001bc18000005d800009160ffd9";
        let byte = |pair: &[u8]| u8::from_str_radix(str::from_utf8(pair).unwrap(), 16).unwrap();
        let stream = STREAM.as_bytes().chunks(2).map(byte).collect::<Vec<_>>();
        let pixels = [
            0, 0, 90, 74, 68, 50, 43, 205, 64, 145, 145, 145, 100, 145, 145, 145,
        ];
        assert_eq!(unpack(&stream, &FOUR_BY_FOUR).unwrap(), pixels);
    }
}
