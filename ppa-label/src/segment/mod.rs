//! Separation of the bones of an ankle in an unlabelled CT.
//!
//! Bone is what is at least half as dense as the densest place nearby ([`solid`]), so that a joint space is detected even
//! if blur and partial volume fill it up to the density of spongy bone. Bones that are still connected are divided at the least dense
//! place by a watershed between shafts, talus and all other pieces that separate by themselves ([`flood`]). Bones that touch over a
//! larger area than a bridge of noise were not separated: for tibia, fibula and talus this is an error that states the place.

mod contacts;
mod fill;
mod flood;
mod solid;

use std::collections::HashMap;

use nalgebra::{Isometry3, Point3};
use ppa_ct::{Grid, Volume, VolumeError};
use ppa_dataset::labels::BoneNumbers;

use self::contacts::Contacts;
use self::flood::{Seeds, flood};
use self::solid::Density;
use super::openness::{AnkleBone, box_around};

/// Bones around an ankle, one number per voxel.
#[derive(Debug, Clone, PartialEq)]
pub struct SegmentedBones {
    /// The lattice of the scan within 60 mm of the joint.
    pub grid: Grid,
    /// One number per voxel, i fastest, 0 for no bone: tibia, fibula and talus by [`BoneNumbers::default`], others from 5, each with its
    /// own number (from the 251st on they share 255).
    pub labels: Vec<u8>,
}

/// Why the bones of an ankle could not be separated.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SegmentError {
    /// No bone was found where one is expected.
    #[error("no {bone} found {where_}")]
    NoBone {
        /// Its name.
        bone: &'static str,
        /// Where it was expected.
        where_: &'static str,
    },
    /// Two bones are connected in the scan.
    #[error(
        "{} and {} are not separated: they touch over {area_mm2:.0} mm² around {:.1}, {:.1}, {:.1} mm (LPS), expected at most \
         {MOST_CONTACT_MM2} mm²; voxels are {:.2} x {:.2} x {:.2} mm", bones[0], bones[1], at[0], at[1], at[2],
        spacing_mm[0], spacing_mm[1], spacing_mm[2]
    )]
    Touching {
        /// Their names.
        bones: [&'static str; 2],
        /// Area of their contact.
        area_mm2: f64,
        /// The middle of the contact, `ct`.
        at: [f64; 3],
        /// Sides of a voxel.
        spacing_mm: [f64; 3],
    },
}

/// Largest contact of separated bones, where noise bridges their gap, mm². A gutter measures 200 mm² and more.
const MOST_CONTACT_MM2: f64 = 30.0;
/// Range in which the shafts of tibia and fibula are searched, mm above the joint.
const SHAFT_MM: [f64; 2] = [30.0, 60.0];
/// Smallest size of a fibula relative to the tibia.
const LEAST_FIBULA: f64 = 0.03;
/// Range in which the trochlea is searched: mm above the joint, and from the axis.
const TROCHLEA_MM: [f64; 2] = [-12.0, -2.0];
const TROCHLEA_RADIUS_MM: f64 = 6.0;
/// Densities, relative to the densest place nearby, at which other bones are searched: half is the surface.
const SHARES: [f32; 3] = [0.5, 0.6, 0.7];
/// Smallest bone that separates only at a higher share, mm³: the smallest of the tarsus are twice as large.
const LEAST_BONE_MM3: f64 = 1000.0;
/// Smallest isolated piece that is not noise, mm³: a ball of 2.7 mm.
const LEAST_PIECE_MM3: f64 = 10.0;
/// First number of the other bones.
const FIRST_OTHER: usize = 5;

/// Separates the bones within 60 mm of an ankle.
///
/// `limb` states for each voxel of the scan whether it belongs to the limb; `ct_from_patient` has the joint at its origin and z
/// along the limb towards proximal.
///
/// # Errors
/// [`SegmentError`] when tibia, fibula or talus is not found, or when two of them touch, with the place.
pub fn segment_bones(
    volume: &Volume,
    limb: &[bool],
    ct_from_patient: &Isometry3<f64>,
) -> Result<SegmentedBones, SegmentError> {
    let whole = volume.grid();
    let (low, size) = box_around(whole, &(ct_from_patient * Point3::origin()));
    let grid = whole
        .crop(low, [0, 1, 2].map(|axis| low[axis] + size[axis]))
        .expect("the box lies in the lattice");
    let voxels: Vec<usize> = (0..grid.len())
        .map(|at| {
            let voxel = grid.voxel(at);
            whole.index([0, 1, 2].map(|axis| low[axis] + voxel[axis]))
        })
        .collect();
    let values = volume.values();
    let hu = voxels.iter().map(|&at| match limb[at] {
        true => values.at(at),
        false => -1000.0,
    });
    let axis = ct_from_patient * nalgebra::Vector3::z();
    let density = Density::new(&grid, hu.collect(), &axis);
    let patient_from_voxel = ct_from_patient.inverse();
    let place = |at: usize| patient_from_voxel * grid.centre(grid.voxel(at).map(|v| v as f64));

    let solid = density.solid(SHARES[0]);
    let mut seeds = Seeds::new(grid.size());
    seed_shafts(&mut seeds, &solid, &place)?;
    let trochlea: Vec<usize> = (0..grid.len())
        .filter(|&at| {
            let p = place(at);
            solid[at] && within(p.z, TROCHLEA_MM) && p.x.hypot(p.y) <= TROCHLEA_RADIUS_MM
        })
        .collect();
    if trochlea.is_empty() {
        return Err(SegmentError::NoBone {
            bone: "talus",
            where_: "within 12 mm below the joint",
        });
    }
    seeds.plant(AnkleBone::Talus as usize, trochlea);
    let voxel_mm3 = grid.spacing_mm().product();
    for share in SHARES {
        let least_mm3 = match share == SHARES[0] {
            true => LEAST_PIECE_MM3,
            false => LEAST_BONE_MM3,
        };
        seeds.plant_others(&density.solid(share), least_mm3 / voxel_mm3);
    }
    let mut bones = flood(&density, &solid, seeds);
    let contacts = Contacts::of(&grid, &bones).merged(&mut bones, MOST_CONTACT_MM2);
    for (n, a) in AnkleBone::ALL.into_iter().enumerate() {
        for b in &AnkleBone::ALL[n + 1..] {
            let contact = contacts.between(a as u16, *b as u16);
            if let Some(contact) = contact.filter(|c| c.area_mm2 > MOST_CONTACT_MM2) {
                return Err(SegmentError::Touching {
                    bones: [a.name(), b.name()],
                    area_mm2: contact.area_mm2,
                    at: contact.middle(),
                    spacing_mm: grid.spacing_mm().into(),
                });
            }
        }
    }
    let labels = numbered(&bones);
    Ok(SegmentedBones { grid, labels })
}

impl SegmentedBones {
    /// The numbers as a volume, to be written as NIfTI, NRRD or MetaImage.
    ///
    /// # Errors
    /// [`VolumeError`] unless there is a number for every voxel.
    pub fn volume(&self) -> Result<Volume, VolumeError> {
        let numbers = self.labels.iter().map(|&n| i16::from(n)).collect();
        Volume::from_i16(self.grid.clone(), numbers)
    }
}

/// Seeds tibia and fibula, the two largest bones of the leg above the ankle.
fn seed_shafts(
    seeds: &mut Seeds,
    solid: &[bool],
    place: &impl Fn(usize) -> Point3<f64>,
) -> Result<(), SegmentError> {
    let shafts: Vec<bool> = (0..solid.len())
        .map(|at| solid[at] && within(place(at).z, SHAFT_MM))
        .collect();
    let mut pieces = seeds.pieces(&shafts);
    pieces.sort_by_key(|piece| std::cmp::Reverse(piece.len()));
    let mut largest = pieces.into_iter();
    let missing = |bone| SegmentError::NoBone {
        bone,
        where_: "30 to 60 mm above the joint",
    };
    let tibia = largest.next().ok_or_else(|| missing("tibia"))?;
    let least = LEAST_FIBULA * tibia.len() as f64;
    let fibula = largest.next().filter(|piece| piece.len() as f64 >= least);
    let fibula = fibula.ok_or_else(|| missing("fibula beside the tibia"))?;
    seeds.plant(AnkleBone::Tibia as usize, tibia);
    seeds.plant(AnkleBone::Fibula as usize, fibula);
    Ok(())
}

fn within(value: f64, [low, high]: [f64; 2]) -> bool {
    (low..=high).contains(&value)
}

/// The numbers used in files: bones other than the three of the joint are numbered in order of their first voxel.
fn numbered(bones: &[Option<u16>]) -> Vec<u8> {
    let numbers = BoneNumbers::default();
    let mut others = HashMap::new();
    let mut number = |bone: u16| match AnkleBone::ALL.get(usize::from(bone)) {
        Some(&named) => named.number(numbers),
        None => {
            let next = FIRST_OTHER + others.len();
            let number = *others.entry(bone).or_insert(next);
            u8::try_from(number).unwrap_or(u8::MAX)
        }
    };
    bones
        .iter()
        .map(|bone| bone.map_or(0, &mut number))
        .collect()
}
