//! Integer sums of the energy imparted, history by history.

use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use crate::dose::settings::VoxelBox;
use crate::transport::tally::nearest;

/// Energy quantum 1/64 eV, as in the image.
pub(crate) const STEPS_PER_KEV: f64 = 64_000.0;

/// Quantum of squared energies per history, 2⁻¹⁰ keV².
pub(crate) const STEPS_PER_KEV2: f64 = 1_024.0;

/// Sums over histories of a quantity and of its square.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct Sum {
    pub value: u128,
    pub square: u128,
}

impl Sum {
    /// Adds the energy of one history, in steps of [`STEPS_PER_KEV`].
    #[inline]
    pub fn count(&mut self, steps: u64) {
        self.value += u128::from(steps);
        self.square += u128::from(square_steps(steps));
    }

    /// Adds two sums; `None` on overflow, which valid tallies never reach.
    pub fn checked_add(self, other: Self) -> Option<Self> {
        Some(Self {
            value: self.value.checked_add(other.value)?,
            square: self.square.checked_add(other.square)?,
        })
    }
}

/// Square of an energy in steps of [`STEPS_PER_KEV`], given in steps of [`STEPS_PER_KEV2`].
#[inline]
pub(crate) fn square_steps(steps: u64) -> u64 {
    let kev = steps as f64 / STEPS_PER_KEV;
    nearest(kev * kev * STEPS_PER_KEV2)
}

/// Energy imparted to the phantom by all histories, and kerma at the detector plane.
#[derive(Debug)]
pub(crate) struct DoseTally {
    sums: Mutex<DoseSums>,
    voxels: Option<(VoxelBox, Vec<[AtomicU64; 2]>)>,
}

/// Sums of everything but the single voxels.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct DoseSums {
    /// The whole phantom.
    pub phantom: Sum,
    /// Kerma of the photons that cross the detector, keV/g · cm² (unit fluence 1/cm² over the detector's area).
    pub detector_kerma: Sum,
    /// By material.
    pub materials: Vec<Sum>,
    /// By region.
    pub regions: Vec<Sum>,
    /// By label.
    pub labels: Vec<Sum>,
}

impl DoseSums {
    pub fn new(materials: usize, regions: usize, labels: usize) -> Self {
        Self {
            phantom: Sum::default(),
            detector_kerma: Sum::default(),
            materials: vec![Sum::default(); materials],
            regions: vec![Sum::default(); regions],
            labels: vec![Sum::default(); labels],
        }
    }

    fn each(&self) -> impl Iterator<Item = &Sum> {
        [&self.phantom, &self.detector_kerma]
            .into_iter()
            .chain(&self.materials)
            .chain(&self.regions)
            .chain(&self.labels)
    }

    fn each_mut(&mut self) -> impl Iterator<Item = &mut Sum> {
        [&mut self.phantom, &mut self.detector_kerma]
            .into_iter()
            .chain(&mut self.materials)
            .chain(&mut self.regions)
            .chain(&mut self.labels)
    }

    /// Adds the other sums; `None` on overflow.
    fn add(&mut self, other: &Self) -> Option<()> {
        for (sum, other) in self.each_mut().zip(other.each()) {
            *sum = sum.checked_add(*other)?;
        }
        Some(())
    }
}

impl DoseTally {
    pub fn new(materials: usize, regions: usize, labels: usize, voxels: Option<VoxelBox>) -> Self {
        Self {
            sums: Mutex::new(DoseSums::new(materials, regions, labels)),
            voxels: voxels.map(|voxels| {
                let count = voxels.size().iter().product();
                (voxels, (0..count).map(|_| Default::default()).collect())
            }),
        }
    }

    /// Adds the counts of one task. They are integers, so the order of tasks does not matter.
    pub fn hand_in(&self, sums: &DoseSums) {
        let mut all = self.sums.lock().expect("no task panics with the lock");
        all.add(sums)
            .expect("2¹²⁸ steps are more than all histories leave");
    }

    /// Counts the energy that one history left in a voxel; voxels outside the box are ignored.
    #[inline]
    pub fn score_voxel(&self, voxel: [usize; 3], steps: u64) {
        let Some((voxels, sums)) = &self.voxels else {
            return;
        };
        if let Some(index) = voxels.index(voxel) {
            let [energy, square] = &sums[index];
            energy.fetch_add(steps, Relaxed);
            square.fetch_add(square_steps(steps), Relaxed);
        }
    }

    /// Whether voxels are counted one by one.
    pub fn counts_voxels(&self) -> bool {
        self.voxels.is_some()
    }

    pub fn sums(&self) -> DoseSums {
        self.sums
            .lock()
            .expect("no task panics with the lock")
            .clone()
    }

    /// Energy and squared energy of every voxel of the box, in steps.
    pub fn voxel_sums(&self) -> Vec<[u64; 2]> {
        self.voxels
            .iter()
            .flat_map(|(_, sums)| sums)
            .map(|[energy, square]| [energy.load(Relaxed), square.load(Relaxed)])
            .collect()
    }

    /// Number of bytes of [`DoseTally::to_bytes`].
    pub fn byte_len(&self) -> usize {
        let sums = self.sums();
        let voxels = self.voxels.as_ref().map_or(0, |(_, sums)| sums.len());
        32 * sums.each().count() + 16 * voxels
    }

    /// Serialises all sums, little-endian.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(self.byte_len());
        for sum in self.sums().each() {
            bytes.extend(sum.value.to_le_bytes());
            bytes.extend(sum.square.to_le_bytes());
        }
        for pair in self.voxel_sums() {
            bytes.extend(pair[0].to_le_bytes());
            bytes.extend(pair[1].to_le_bytes());
        }
        bytes
    }

    /// Adds the sums of [`DoseTally::to_bytes`] from a tally of the same shape; `None` on overflow.
    pub fn add_bytes(&mut self, bytes: &[u8]) -> Option<()> {
        assert_eq!(bytes.len(), self.byte_len(), "tallies of one shape");
        let sums = self.sums.get_mut().expect("no task panics with the lock");
        let (few, voxels) = bytes.split_at(32 * sums.each().count());
        let wide = |bytes: &[u8]| u128::from_le_bytes(bytes.try_into().expect("16 bytes"));
        for (sum, bytes) in sums.each_mut().zip(few.chunks_exact(32)) {
            let (value, square) = bytes.split_at(16);
            *sum = sum.checked_add(Sum {
                value: wide(value),
                square: wide(square),
            })?;
        }
        let here = self.voxels.iter_mut().flat_map(|(_, sums)| sums).flatten();
        for (sum, bytes) in here.zip(voxels.chunks_exact(8)) {
            let word = u64::from_le_bytes(bytes.try_into().expect("8 bytes"));
            *sum.get_mut() = sum.get_mut().checked_add(word)?;
        }
        Some(())
    }
}
