//! Short JPEG 2000 streams whose headers ask for gigabytes.

use dicom_core::value::PixelFragmentSequence;
use dicom_core::{DataElement, PrimitiveValue, Tag, VR};
use dicom_dictionary_std::{tags, uids};
use ppa_ct::{ReadError, Scan, read};

use crate::series::SliceSpec;

/// Header fields of a stream of one component with 8 bits.
#[derive(Clone, Copy)]
struct Stream {
    size: u32,
    tile: u32,
    step: u8,
    layers: u16,
    levels: u8,
    /// Exponents of a code-block's sides, minus 2.
    block: u8,
    /// Exponents of all precincts' sides.
    precinct: Option<u8>,
    progression_changes: usize,
    /// A second set of coding parameters, in the header of the tile-part: its levels and precincts.
    in_tile: Option<(u8, u8)>,
}

const PLAIN: Stream = Stream {
    size: 4,
    tile: 4,
    step: 1,
    layers: 1,
    levels: 0,
    block: 4,
    precinct: None,
    progression_changes: 0,
    in_tile: None,
};

fn segment(marker: u8, body: &[u8]) -> Vec<u8> {
    let length = (body.len() as u16 + 2).to_be_bytes();
    [&[0xff, marker], &length[..], body].concat()
}

impl Stream {
    fn coding(&self, levels: u8, precinct: Option<u8>) -> Vec<u8> {
        let [high, low] = self.layers.to_be_bytes();
        let own = u8::from(precinct.is_some());
        let start = [own, 0, high, low, 0, levels, self.block, self.block, 0, 1];
        let precincts = precinct.map_or(vec![], |p| vec![p << 4 | p; usize::from(levels) + 1]);
        segment(0x52, &[&start[..], &precincts].concat())
    }

    /// The stream with one empty packet, padded by comments to the given length.
    fn bytes(&self, length: usize) -> Vec<u8> {
        let (size, tile) = (self.size, self.tile);
        let sizes = [size, size, 0, 0, tile, tile, 0, 0].map(u32::to_be_bytes);
        let parts = [0, 1, 7, self.step, self.step];
        let steps = [0x40; 3 * 32 + 1];
        let mut stream = [
            vec![0xff, 0x4f],
            segment(0x51, &[&[0; 2], sizes.as_flattened(), &parts].concat()),
            self.coding(self.levels, self.precinct),
            segment(0x5c, &[&[0x40], &steps[..]].concat()),
        ]
        .concat();
        for _ in 0..self.progression_changes {
            stream.extend(segment(0x5f, &[0, 0, 0, 1, 33, 1, 2]));
        }
        while stream.len() + 40 < length {
            let rest = (length - stream.len() - 40).clamp(4, 60_000);
            stream.extend(segment(0x64, &vec![0; rest]));
        }
        let tile_header = self.in_tile.map_or(vec![], |(levels, precinct)| {
            self.coding(levels, Some(precinct))
        });
        let [.., l1, l0] = (12 + tile_header.len() + 3).to_be_bytes();
        stream.extend(segment(0x90, &[0, 0, 0, 0, l1, l0, 0, 1]));
        [stream, tile_header, vec![0xff, 0x93, 0, 0xff, 0xd9]].concat()
    }

    /// Reads the stream as the only slice of a series.
    fn read(&self, length: usize) -> Result<Scan, ReadError> {
        read_frame(
            self.size.div_ceil(self.step.into()) as u16,
            &self.bytes(length),
        )
    }
}

/// Reads a frame of `side` x `side` pixels of 8 bits.
fn read_frame(side: u16, frame: &[u8]) -> Result<Scan, ReadError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("frame.dcm");
    let slice = SliceSpec {
        syntax: uids::JPEG2000_LOSSLESS,
        ..SliceSpec::axial([1, 1], 0.0, |_, _| 0)
    };
    slice.write_changed(&path, |object| {
        let mut put = |tag: Tag, number: u16| {
            object.put(DataElement::new(tag, VR::US, PrimitiveValue::from(number)));
        };
        put(tags::ROWS, side);
        put(tags::COLUMNS, side);
        put(tags::BITS_ALLOCATED, 8);
        put(tags::BITS_STORED, 8);
        put(tags::HIGH_BIT, 7);
        put(tags::PIXEL_REPRESENTATION, 0);
        let fragments = PixelFragmentSequence::new_fragments(vec![frame.to_vec()]);
        object.put(DataElement::new(tags::PIXEL_DATA, VR::OB, fragments));
    });
    read(&path)
}

fn refused(scan: Result<Scan, ReadError>) -> String {
    let error = scan.unwrap_err();
    assert!(matches!(error, ReadError::TransferSyntax { .. }), "{error}");
    std::error::Error::source(&error).unwrap().to_string()
}

#[test]
fn an_empty_packet_is_a_grey_image() {
    let scan = PLAIN.read(0).unwrap();
    assert_eq!(scan.volume.grid().size(), [4, 4, 1]);
    assert!(scan.volume.values().iter().all(|v| v == 128.0));
    let levels = Stream {
        size: 64,
        tile: 32,
        levels: 3,
        precinct: Some(4),
        ..PLAIN
    };
    // Missing tiles and packets are grey as well.
    assert!(levels.read(0).is_ok());
}

#[test]
fn what_headers_ask_for_is_bounded() {
    let large = Stream {
        size: 6000,
        tile: 6000,
        ..PLAIN
    };
    for (stream, part) in [
        (
            Stream { tile: 1, ..large },
            "tiles: 36000000, expected at most",
        ),
        (
            Stream { tile: 20, ..large },
            "tiles: 90000, expected at most",
        ),
        (
            Stream {
                precinct: Some(1),
                ..large
            },
            "packets: 9000000, expected at most",
        ),
        (
            Stream {
                in_tile: Some((1, 2)),
                ..large
            },
            "packets: ",
        ),
        (
            Stream {
                block: 0,
                layers: 32,
                ..large
            },
            "contributions of code-blocks to layers: 72000000",
        ),
        (
            Stream {
                levels: 32,
                ..PLAIN
            },
            "decomposition levels: 32, expected at most 16",
        ),
        (
            Stream {
                size: 20_000_000,
                tile: 20_000_000,
                step: 255,
                ..PLAIN
            },
            "coordinates up to 20000000",
        ),
        (
            Stream {
                progression_changes: 65,
                ..PLAIN
            },
            "cannot be parsed",
        ),
    ] {
        let said = refused(stream.read(102_000));
        assert!(said.contains(part), "{part}: {said}");
    }
    #[cfg(target_os = "linux")]
    assert!(
        peak_kib() < 1 << 20,
        "{} KiB, 6.4 GB without a bound",
        peak_kib()
    );
    let allowed = Stream {
        progression_changes: 64,
        ..PLAIN
    };
    assert!(allowed.read(0).is_ok());
}

/// Peak memory of this process so far.
#[cfg(target_os = "linux")]
fn peak_kib() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let line = status
        .lines()
        .find_map(|l| l.strip_prefix("VmHWM:"))
        .unwrap();
    line.trim().trim_end_matches(" kB").parse().unwrap()
}

/// The decoder skips some segments by length and others by content.
#[test]
fn segments_of_wrong_length_are_refused() {
    let right = PLAIN.bytes(0);
    assert!(read_frame(4, &right).is_ok());
    for marker in [0x51, 0x52, 0x90] {
        let at = right.windows(2).position(|w| w == [0xff, marker]).unwrap();
        let mut longer = right.clone();
        longer[at + 3] += 2;
        longer.splice(at + 4..at + 4, [0, 0]);
        let said = refused(read_frame(4, &longer));
        assert!(
            said.contains("cannot be parsed") || said.contains("components"),
            "{said}"
        );
    }
    for length in 0..right.len() {
        assert!(read_frame(4, &right[..length]).is_err(), "{length}");
    }
}

#[test]
fn a_codestream_in_a_jp2_file_is_read_unless_it_has_a_palette() {
    let boxed = |kind: &[u8], body: &[u8]| {
        let length = (body.len() as u32 + 8).to_be_bytes();
        [&length[..], kind, body].concat()
    };
    let file = |header: &[u8]| {
        [
            b"\0\0\0\x0cjP  \x0d\x0a\x87\x0a".to_vec(),
            boxed(b"ftyp", b"jp2 \0\0\0\0jp2 "),
            boxed(b"jp2h", header),
            boxed(b"jp2c", &PLAIN.bytes(0)),
        ]
        .concat()
    };
    let plain = read_frame(4, &PLAIN.bytes(0)).unwrap();
    assert_eq!(read_frame(4, &file(b"")).unwrap().volume, plain.volume);
    let said = refused(read_frame(4, &file(&boxed(b"pclr", &[0; 8]))));
    assert!(said.contains("a palette"), "{said}");
    let said = refused(read_frame(4, &file(b"")[..60]));
    assert!(said.contains("no codestream"), "{said}");
}
