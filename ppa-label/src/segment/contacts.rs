//! Contacts between bones.

use std::collections::BTreeMap;

use nalgebra::Vector3;
use ppa_ct::Grid;

use crate::AnkleBone;

/// The faces of voxels between two bones.
#[derive(Debug, Clone, Copy)]
pub(super) struct Contact {
    pub area_mm2: f64,
    /// Sum of position in `ct` times area.
    moment: Vector3<f64>,
}

impl Contact {
    /// The middle of the faces, `ct`.
    pub fn middle(&self) -> [f64; 3] {
        (self.moment / self.area_mm2).into()
    }
}

/// Contacts by pair of bones, the smaller number first.
pub(super) struct Contacts(BTreeMap<[u16; 2], Contact>);

impl Contacts {
    pub fn of(grid: &Grid, bones: &[Option<u16>]) -> Self {
        let (size, spacing) = (grid.size(), grid.spacing_mm());
        let strides = [1, size[0], size[0] * size[1]];
        let mut contacts = Self(BTreeMap::new());
        for (at, bone) in bones.iter().enumerate() {
            let Some(bone) = *bone else { continue };
            let voxel = grid.voxel(at);
            for axis in (0..3).filter(|&axis| voxel[axis] + 1 < size[axis]) {
                let Some(other) = bones[at + strides[axis]].filter(|&other| other != bone) else {
                    continue;
                };
                let area_mm2 = spacing.product() / spacing[axis];
                let mut face = voxel.map(|v| v as f64);
                face[axis] += 0.5;
                let moment = grid.centre(face).coords * area_mm2;
                contacts.add([bone, other], Contact { area_mm2, moment });
            }
        }
        contacts
    }

    pub fn between(&self, a: u16, b: u16) -> Option<&Contact> {
        self.0.get(&[a.min(b), a.max(b)])
    }

    fn add(&mut self, [a, b]: [u16; 2], more: Contact) {
        let sum = self.0.entry([a.min(b), a.max(b)]).or_insert(Contact {
            area_mm2: 0.0,
            moment: Vector3::zeros(),
        });
        sum.area_mm2 += more.area_mm2;
        sum.moment += more.moment;
    }

    /// Merges each unnamed bone that touches another over more than `most_mm2`, since it was part of it or not separated from it, into
    /// the bone that it touches most. Large contacts first.
    pub fn merged(mut self, bones: &mut [Option<u16>], most_mm2: f64) -> Self {
        let mut joins = BTreeMap::new();
        let named = AnkleBone::ALL.len() as u16;
        loop {
            let unnamed = self.0.iter().filter(|([_, b], _)| *b >= named);
            let largest = unnamed.max_by(|a, b| a.1.area_mm2.total_cmp(&b.1.area_mm2));
            let Some((&[into, gone], _)) = largest.filter(|(_, c)| c.area_mm2 > most_mm2) else {
                break;
            };
            joins.insert(gone, into);
            for (pair, contact) in std::mem::take(&mut self.0) {
                let pair = pair.map(|bone| if bone == gone { into } else { bone });
                if pair[0] != pair[1] {
                    self.add(pair, contact);
                }
            }
        }
        for bone in bones.iter_mut().flatten() {
            while let Some(&into) = joins.get(bone) {
                *bone = into;
            }
        }
        self
    }
}
