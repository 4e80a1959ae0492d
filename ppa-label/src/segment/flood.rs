//! Pieces of bone, and the watershed between them.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::fill::neighbours;
use super::solid::Density;
use crate::AnkleBone;

/// Seed voxels of each bone: 0 to 2 are those of [`AnkleBone`], others have no name.
pub(super) struct Seeds {
    size: [usize; 3],
    bones: usize,
    of: Vec<Option<u16>>,
}

impl Seeds {
    pub fn new(size: [usize; 3]) -> Self {
        Self {
            size,
            bones: AnkleBone::ALL.len(),
            of: vec![None; size.iter().product()],
        }
    }

    pub fn plant(&mut self, bone: usize, voxels: Vec<usize>) {
        for at in voxels {
            self.of[at] = Some(bone as u16);
        }
    }

    /// Plants a new bone in every piece of at least `least` voxels that contains no seed yet.
    pub fn plant_others(&mut self, solid: &[bool], least: f64) {
        for piece in self.pieces(solid) {
            let free = piece.iter().all(|&at| self.of[at].is_none());
            if free && piece.len() as f64 >= least && self.bones < usize::from(u16::MAX) {
                self.plant(self.bones, piece);
                self.bones += 1;
            }
        }
    }

    /// Pieces connected through faces, in order of the first voxel.
    pub fn pieces(&self, solid: &[bool]) -> Vec<Vec<usize>> {
        let mut seen = vec![false; solid.len()];
        let mut pieces = Vec::new();
        for start in 0..solid.len() {
            if seen[start] || !solid[start] {
                continue;
            }
            seen[start] = true;
            let mut piece = vec![start];
            let mut next = 0;
            while next < piece.len() {
                for near in neighbours(self.size, piece[next]) {
                    if solid[near] && !seen[near] {
                        seen[near] = true;
                        piece.push(near);
                    }
                }
                next += 1;
            }
            pieces.push(piece);
        }
        pieces
    }
}

/// Assigns every solid voxel connected to a seed to the one with the densest path to it, where the density of a path is that of
/// its least dense voxel: a watershed of the density (Meyer, Signal Processing 38, 1994, 113).
pub(super) fn flood(density: &Density, solid: &[bool], seeds: Seeds) -> Vec<Option<u16>> {
    let mut bones = seeds.of;
    // Shares are positive, so their bits are in the same order; of equal ones, the first voxel comes first.
    let key = |share: f32, at: usize| (share.to_bits(), Reverse(at));
    let mut front: BinaryHeap<_> = (0..bones.len())
        .filter(|&at| bones[at].is_some())
        .map(|at| key(1.0, at))
        .collect();
    while let Some((level, Reverse(at))) = front.pop() {
        for near in neighbours(density.size, at) {
            if solid[near] && bones[near].is_none() {
                bones[near] = bones[at];
                let way = f32::from_bits(level).min(density.share[near].max(0.0));
                front.push(key(way, near));
            }
        }
    }
    bones
}
