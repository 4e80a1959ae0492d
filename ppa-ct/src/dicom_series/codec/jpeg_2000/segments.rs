//! The marker segments of a JPEG 2000 codestream that determine the cost of decoding (ISO/IEC 15444-1, annex A).

use std::collections::HashMap;

use super::super::{marker, segment};

/// Largest number of progression changes accepted: as many as layers and resolutions of any realistic stream. Each makes
/// the decoder sort all precincts once more.
const CHANGES_AT_MOST: usize = 64;

/// Sizes on the reference grid, x before y (section A.5.1).
#[derive(Debug)]
pub(super) struct Size {
    /// Start and end of the image.
    pub start: [u64; 2],
    pub end: [u64; 2],
    /// Size of a tile, and the start of the first one.
    pub tile: [u64; 2],
    pub tile_start: [u64; 2],
    pub components: usize,
    /// Steps of the grid between neighbouring pixels of the first component.
    pub step: [u64; 2],
}

/// Coding parameters of a tile (sections A.6.1 and A.6.2).
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Coding {
    pub layers: u64,
    pub levels: u8,
    /// Exponents of a code-block's sides.
    pub block: [u8; 2],
    /// Exponents of the precincts' sides by resolution; empty means 15.
    precincts: Vec<u8>,
}

impl Coding {
    /// Exponents of the sides of a resolution's precincts.
    pub fn precinct(&self, resolution: u8) -> [u8; 2] {
        let both = self.precincts.get(usize::from(resolution));
        both.map_or([15, 15], |both| [both & 0xf, both >> 4])
    }

    /// Reads the part that two segments have in common, from the number of levels on; `None` unless it fills the rest.
    fn component(&mut self, own_precincts: bool, body: &[u8]) -> Option<()> {
        let [levels, width, height, _, _, precincts @ ..] = body else {
            return None;
        };
        let expected = if own_precincts {
            usize::from(*levels) + 1
        } else {
            0
        };
        if precincts.len() != expected || *width > 8 || *height > 8 {
            return None;
        }
        self.levels = *levels;
        self.block = [width + 2, height + 2];
        self.precincts = precincts.to_vec();
        Some(())
    }

    fn apply(&mut self, marker: u8, body: &[u8]) -> Option<()> {
        match (marker, body) {
            (0x52, [style, _, high, low, _, rest @ ..]) => {
                self.layers = u16::from_be_bytes([*high, *low]).into();
                self.component(style & 1 != 0, rest)
            }
            // Parameters of the only component.
            (0x53, [0, style, rest @ ..]) => self.component(style & 1 != 0, rest),
            _ => None,
        }
    }
}

/// Contents of the headers of a codestream and of its tile-parts.
#[derive(Debug)]
pub(super) struct Segments {
    pub size: Size,
    coding: Coding,
    by_tile: HashMap<u64, Coding>,
}

impl Segments {
    /// Reads the segments in order; `None` if they violate the standard.
    ///
    /// The lengths of segments must match their contents: the decoder skips some by length and others by content,
    /// and must not interpret the stream differently from this function.
    pub fn read(stream: &[u8]) -> Option<Self> {
        let mut rest = stream.strip_prefix(&[0xff, 0x4f, 0xff, 0x51])?;
        let size = size(segment(&mut rest)?)?;
        let mut coding = Coding {
            layers: 0,
            levels: 0,
            block: [0; 2],
            precincts: Vec::new(),
        };
        let (mut of_component, mut changes) = (None, 0);
        while !rest.starts_with(&SOT) {
            match marker(&mut rest)? {
                0x53 => of_component = Some(segment(&mut rest)?),
                0x52 => coding.apply(0x52, segment(&mut rest)?)?,
                other => skip(other, &mut rest, &mut changes)?,
            }
        }
        if let Some(body) = of_component {
            coding.apply(0x53, body)?;
        }
        let mut by_tile = HashMap::<u64, Coding>::new();
        while rest.starts_with(&SOT) {
            let mut header = rest.get(2..)?;
            let [high, low, l3, l2, l1, l0, _, _] = *segment(&mut header)? else {
                return None;
            };
            let tile = u64::from(u16::from_be_bytes([high, low]));
            let length = u32::from_be_bytes([l3, l2, l1, l0]) as usize;
            let length = if length == 0 { rest.len() } else { length };
            let part = rest.get(..length)?;
            let mut inside = part.get(12..)?;
            // Up to the start of data, or the end of a codestream without data.
            while !inside.starts_with(&[0xff, 0x93]) && !inside.starts_with(&[0xff, 0xd9]) {
                match marker(&mut inside)? {
                    kind @ (0x52 | 0x53) => {
                        let own = by_tile.entry(tile).or_insert_with(|| coding.clone());
                        own.apply(kind, segment(&mut inside)?)?;
                    }
                    other => skip(other, &mut inside, &mut changes)?,
                }
            }
            rest = &rest[length..];
        }
        Some(Self {
            size,
            coding,
            by_tile,
        })
    }

    /// Coding parameters of a tile.
    pub fn coding(&self, tile: u64) -> &Coding {
        self.by_tile.get(&tile).unwrap_or(&self.coding)
    }

    /// Coding parameters of all tiles.
    pub fn codings(&self) -> impl Iterator<Item = &Coding> {
        self.by_tile.values().chain([&self.coding])
    }
}

/// Start of a tile-part.
const SOT: [u8; 2] = [0xff, 0x90];

/// Skips a segment that does not affect the cost, if its length is valid.
fn skip(marker: u8, rest: &mut &[u8], changes: &mut usize) -> Option<()> {
    // Markers without a segment (table A.1).
    if (0x30..=0x3f).contains(&marker) {
        return Some(());
    }
    let body = segment(rest)?;
    let right = match marker {
        0x5c => quantization(body),
        0x5d => quantization(body.split_first()?.1),
        0x5e => body.len() == 3,
        0x5f => {
            *changes += body.len() / 7;
            *changes <= CHANGES_AT_MOST
        }
        _ => true,
    };
    right.then_some(())
}

/// Whether the quantization steps fill their segment (section A.6.4).
fn quantization(body: &[u8]) -> bool {
    match body {
        [style, steps @ ..] => match style & 0x1f {
            0 => true,
            1 => steps.len() == 2,
            _ => steps.len() % 2 == 0,
        },
        [] => false,
    }
}

fn size(body: &[u8]) -> Option<Size> {
    let (numbers, parts) = body.get(2..)?.split_first_chunk::<32>()?;
    let (words, _) = numbers.as_chunks::<4>();
    let pair = |n: usize| [words[n], words[n + 1]].map(|word| u64::from(u32::from_be_bytes(word)));
    let [high, low, parts @ ..] = parts else {
        return None;
    };
    let components = u16::from_be_bytes([*high, *low]);
    let [_, x, y, ..] = parts else { return None };
    let size = Size {
        end: pair(0),
        start: pair(2),
        tile: pair(4),
        tile_start: pair(6),
        components: components.into(),
        step: [(*x).into(), (*y).into()],
    };
    let right = parts.len() == 3 * usize::from(components)
        && (0..2).all(|n| {
            size.start[n] < size.end[n]
                && size.tile_start[n] <= size.start[n]
                && size.start[n] < size.tile_start[n] + size.tile[n]
                && size.step[n] > 0
        });
    right.then_some(size)
}
