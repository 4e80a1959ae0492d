//! Class of each voxel in the box that holds everything but the couch.

use rayon::prelude::*;

use super::couch::Columns;
use super::lattice::Lattice;
use super::pieces::Pieces;
use super::{Hu, LimbSettings};

/// Bits of a voxel's kind: above the skin's HU, above that of solid flesh, above that of bone.
pub const TISSUE: u8 = 1;
pub const CORE: u8 = 2;
pub const BONE: u8 = 4;
/// Set with [`TISSUE`] and [`CORE`]: below the skin's HU, but enclosed by solid flesh.
pub const ENCLOSED: u8 = 8;

/// Voxels that are not couch.
pub struct Tissue {
    /// The box around all tissue, with one voxel of air where the volume has one.
    pub lattice: Lattice,
    /// Kind of each voxel of the box.
    pub kinds: Vec<u8>,
}

impl Tissue {
    /// Finds the tissue; `None` if there is none.
    pub fn find<T: Hu>(
        whole: &Lattice,
        hu: &[T],
        couch: &Columns,
        choices: &LimbSettings,
    ) -> Option<Self> {
        let [iso, core, bone] =
            [choices.iso_hu, choices.core_hu, choices.bone_hu].map(|hu| hu as f32);
        let any_couch = couch.couch.contains(&true);
        let [nx, ny, _] = whole.size;
        let (low, high) = (0..hu.len() / nx)
            .into_par_iter()
            .filter_map(|row| {
                let (j, k) = (row % ny, row / ny);
                let line = whole.row_of(row, hu);
                let is = |i: &usize| {
                    line[*i].into() >= iso && !(any_couch && couch.is_couch([*i, j, k]))
                };
                let first = (0..nx).find(is)?;
                let last = (0..nx).rev().find(is)?;
                Some(([first, j, k], [last + 1, j + 1, k + 1]))
            })
            .reduce_with(|(low, high), (l, h)| {
                let axes = [0, 1, 2];
                (
                    axes.map(|x| low[x].min(l[x])),
                    axes.map(|x| high[x].max(h[x])),
                )
            })?;
        let lattice = whole.window_around(low, high, 1);
        let mut kinds = vec![0_u8; lattice.len()];
        let [nx, ny, _] = lattice.size;
        kinds
            .par_chunks_mut(nx)
            .enumerate()
            .for_each(|(row, kinds)| {
                let (j, k) = (row % ny + lattice.low[1], row / ny + lattice.low[2]);
                let line = lattice.row_of(row, hu);
                for (kind, &hu) in kinds.iter_mut().zip(line) {
                    let hu = hu.into();
                    let solid = CORE * u8::from(hu >= core) + BONE * u8::from(hu >= bone);
                    *kind = if hu >= iso { TISSUE + solid } else { 0 };
                }
                if any_couch {
                    for (i, kind) in kinds.iter_mut().enumerate().filter(|(_, kind)| **kind > 0) {
                        if couch.is_couch([i + lattice.low[0], j, k]) {
                            *kind = 0;
                        }
                    }
                }
            });
        Some(Self { lattice, kinds })
    }

    /// Marks cavities that solid flesh separates from the border of the box as flesh: marrow, air in wounds
    /// and joints. Otherwise a limb would be shallow around each of them and fall into pieces there.
    pub fn fill_enclosed(&mut self) {
        let hollows = Pieces::of(&self.lattice, |at| !self.is(at, CORE));
        for (enclosed, voxels) in hollows.enclosed(&self.lattice) {
            if !enclosed {
                continue;
            }
            for kind in &mut self.kinds[voxels] {
                *kind |= CORE
                    + if *kind & TISSUE == 0 {
                        ENCLOSED + TISSUE
                    } else {
                        0
                    };
            }
        }
    }

    pub fn is(&self, at: usize, kind: u8) -> bool {
        self.kinds[at] & kind != 0
    }
}
