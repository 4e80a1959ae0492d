//! Upper bound on the work of decoding a JPEG 2000 codestream, from its headers (ISO/IEC 15444-1, annexes A and B).
//!
//! The decoder reserves memory by tile, precinct, code-block and layer before it looks at their data, so that a few bytes could make it reserve
//! gigabytes. All of these are therefore counted here first and compared with the numbers of bytes and pixels present.

use super::super::{CodecError, expect_grey};
use super::segments::{Coding, Segments, Size};

/// Number of tiles that any stream may have; each further tile takes at least 14 bytes (SOT and SOD, sections A.4.2 and A.4.3).
const TILES_ALWAYS: u64 = 1 << 10;
/// Size of the shortest tile-part in bytes.
const TILE_BYTES: u64 = 14;
/// Largest number of tiles that the index of a tile-part can count (table A.5).
const TILES_AT_MOST: u64 = 65_535;
/// Number of packets that any stream may have; each further packet takes at least a byte (section B.10.1).
const PACKETS_ALWAYS: u64 = 1 << 16;
/// Number of contributions of code-blocks to layers that any stream may have. Beyond it, the number of pixels per
/// contribution is limited: blocks of 64 x 64 pixels in 16 layers have 256, the smallest blocks in one layer have 16.
const CONTRIBUTIONS_ALWAYS: u64 = 1 << 16;
const PIXELS_PER_CONTRIBUTION: u64 = 4;
/// Largest coordinate: 65535 pixels, each up to 255 steps of the reference grid apart.
const FARTHEST: u64 = 65_535 * 255;
/// Largest number of halvings of the image: 65535 pixels are reduced to one after 16.
const LEVELS_AT_MOST: u8 = 16;

/// Refuses a codestream that needs more work than its bytes and pixels justify.
pub(super) fn check(stream: &[u8]) -> Result<(), CodecError> {
    let segments = Segments::read(stream).ok_or_else(|| {
        CodecError::Damaged("the headers of the codestream cannot be parsed".to_owned())
    })?;
    let size = &segments.size;
    expect_grey(size.components)?;
    at_most("coordinates up to", size.farthest(), FARTHEST)?;
    let bytes = stream.len() as u64;
    let tiles = TILES_AT_MOST.min(TILES_ALWAYS + bytes / TILE_BYTES);
    at_most("tiles:", size.tiles(), tiles)?;
    for coding in segments.codings() {
        at_most(
            "decomposition levels:",
            coding.levels.into(),
            LEVELS_AT_MOST.into(),
        )?;
    }
    let most_packets = PACKETS_ALWAYS + bytes;
    let most_contributions = CONTRIBUTIONS_ALWAYS + size.pixels() / PIXELS_PER_CONTRIBUTION;
    let mut packets = 0_u64;
    for tile in 0..size.tiles() {
        let cost = segments.coding(tile).cost(size.tile(tile));
        packets = packets.saturating_add(cost.packets);
        at_most("packets:", packets, most_packets)?;
        at_most(
            "contributions of code-blocks to layers:",
            cost.contributions,
            most_contributions,
        )?;
    }
    Ok(())
}

fn at_most(what: &'static str, found: u64, most: u64) -> Result<(), CodecError> {
    if found <= most {
        return Ok(());
    }
    Err(CodecError::Unexpected {
        found: format!("{what} {found}"),
        expected: format!("at most {most} for its size"),
    })
}

/// Cost of decoding one tile.
struct Cost {
    /// Packets: precincts of all resolutions, in every layer.
    packets: u64,
    /// Code-blocks of all sub-bands, in every layer.
    contributions: u64,
}

impl Coding {
    /// Returns the cost of a tile of the component, `[x0, y0, x1, y1]` in its pixels.
    fn cost(&self, tile: [u64; 4]) -> Cost {
        let (mut precincts, mut blocks) = (0_u64, 0_u64);
        for resolution in 0..=self.levels {
            let above = self.levels - resolution;
            let rect = tile.map(|v| v.div_ceil(1 << above));
            let [x, y] = self.precinct(resolution);
            let across = cells([rect[0], rect[2]], x);
            precincts = precincts.saturating_add(across * cells([rect[1], rect[3]], y));
            // Above the lowest resolution, precincts are halved into three sub-bands (equation B-15).
            let halved = u8::from(resolution > 0);
            let block = [(self.block[0], x), (self.block[1], y)]
                .map(|(block, precinct)| block.min(precinct.saturating_sub(halved)));
            let bands: &[[u64; 2]] = match resolution {
                0 => &[[0, 0]],
                _ => &[[1, 0], [0, 1], [1, 1]],
            };
            let level = above + halved;
            for [right, low] in bands {
                let [x0, y0, x1, y1] = tile;
                let place = |v: u64, odd: u64| {
                    let shift = if level == 0 { 0 } else { odd << (level - 1) };
                    v.saturating_sub(shift).div_ceil(1 << level)
                };
                let across = cells([place(x0, *right), place(x1, *right)], block[0]);
                let down = cells([place(y0, *low), place(y1, *low)], block[1]);
                blocks = blocks.saturating_add(across * down);
            }
        }
        Cost {
            packets: precincts.saturating_mul(self.layers),
            contributions: blocks.saturating_mul(self.layers),
        }
    }
}

/// Number of cells of size `2^exponent` that a range touches.
fn cells([from, to]: [u64; 2], exponent: u8) -> u64 {
    if from >= to {
        return 0;
    }
    to.div_ceil(1 << exponent) - (from >> exponent)
}

impl Size {
    /// Tiles across and down (equation B-5).
    fn tiles_each_way(&self) -> [u64; 2] {
        [0, 1].map(|n| (self.end[n] - self.tile_start[n]).div_ceil(self.tile[n]))
    }

    fn tiles(&self) -> u64 {
        let [across, down] = self.tiles_each_way();
        across * down
    }

    fn farthest(&self) -> u64 {
        self.end[0].max(self.end[1])
    }

    fn pixels(&self) -> u64 {
        let side = |n: usize| {
            let [from, to] = [self.start[n], self.end[n]].map(|v| v.div_ceil(self.step[n]));
            to - from
        };
        side(0) * side(1)
    }

    /// Returns a tile in pixels of the component, `[x0, y0, x1, y1]` (equations B-7 to B-12).
    fn tile(&self, index: u64) -> [u64; 4] {
        let across = self.tiles_each_way()[0];
        let place = [index % across, index / across];
        let end = |n: usize, along: u64| {
            let edge = self.tile_start[n] + along * self.tile[n];
            edge.clamp(self.start[n], self.end[n])
                .div_ceil(self.step[n])
        };
        [
            end(0, place[0]),
            end(1, place[1]),
            end(0, place[0] + 1),
            end(1, place[1] + 1),
        ]
    }
}
