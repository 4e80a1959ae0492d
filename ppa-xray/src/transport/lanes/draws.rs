//! Random numbers of many histories, and the optical depths sampled from them.

use ppa_core::random::philox;

use crate::isa::Kernel;
use crate::matter::natural_log::ln;
use crate::transport::lanes::flights::{Each, LANES};
use crate::transport::stream::Stream;

/// Random numbers of many histories: one Philox block each.
#[derive(Debug)]
pub(super) struct Draws {
    pub counter: [Each<u32>; 4],
    pub block: [Each<u32>; 4],
}

impl Draws {
    /// Blocks of `stream`: the last word of every counter.
    pub fn new(stream: Stream) -> Self {
        Self {
            counter: [[0; LANES], [0; LANES], [0; LANES], [stream as u32; LANES]],
            block: [[0; LANES]; 4],
        }
    }

    #[inline(always)]
    pub fn block(&self, photon: usize) -> [u32; 4] {
        let [a, b, c, d] = &self.block;
        [a[photon], b[photon], c[photon], d[photon]]
    }
}

/// Uniform in (0, 1]: fine near zero, so that free paths reach 22 mean free paths.
#[inline(always)]
fn open_unit(word: u32) -> f32 {
    // Halves are exact in `f32`, and signed conversions take one instruction.
    let half = (word >> 1) as i32 as f32;
    (half + 0.25) * (1.0 / 2_147_483_648.0)
}

/// Uniform in [0, 1) in steps of 2⁻²⁴.
#[inline(always)]
pub(super) fn unit(word: u32) -> f32 {
    (word >> 8) as i32 as f32 * (1.0 / 16_777_216.0)
}

/// One Philox block per photon.
pub(super) struct Draw<'a> {
    pub key: [u32; 2],
    pub draws: &'a mut Draws,
    pub count: usize,
}

impl Kernel for Draw<'_> {
    #[inline(always)]
    fn run(self) {
        let Draws { counter, block } = self.draws;
        let key = self.key;
        for i in 0..self.count.min(LANES) {
            let [a, b, c, d] = philox(
                [counter[0][i], counter[1][i], counter[2][i], counter[3][i]],
                key,
            );
            block[0][i] = a;
            block[1][i] = b;
            block[2][i] = c;
            block[3][i] = d;
        }
    }
}

/// Samples optical depths of mean 1 from one random word each.
pub(super) struct Depths<'a> {
    pub word: &'a Each<u32>,
    pub depth: &'a mut Each<f32>,
    pub count: usize,
}

impl Kernel for Depths<'_> {
    #[inline(always)]
    fn run(self) {
        for i in 0..self.count.min(LANES) {
            self.depth[i] = -ln(open_unit(self.word[i]));
        }
    }
}
