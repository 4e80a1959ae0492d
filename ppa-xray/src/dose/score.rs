//! Collects the deposits of each history and hands them to the dose tally when it ends.

use ppa_core::random::Philox;

use crate::beam::raster::Raster;
use crate::dose::air_kerma::AirKerma;
use crate::dose::settings::VoxelBox;
use crate::dose::tally::{DoseSums, DoseTally, STEPS_PER_KEV, Sum};
use crate::dose::voxel_labels::LabelNumbers;
use crate::phantom::voxels::VoxelPhantom;
use crate::transport::score::{Arrival, Score};
use crate::transport::tally::nearest;

/// Cosine below which a photon counts with half this cosine, so that grazing photons do not ruin the variance: the mean of
/// 1/cos over a uniform angular flux (Clark, Nucl. Sci. Eng. 27 (1967) 235).
const GRAZING_COS: f64 = 0.1;

/// Data shared by the scorers of one simulation.
pub(crate) struct DoseTarget<'a> {
    pub phantom: &'a VoxelPhantom,
    pub regions: &'a [VoxelBox],
    /// Labels of the voxels, with the number of those that are counted.
    pub labels: Option<(&'a [u8], LabelNumbers)>,
    pub tally: &'a DoseTally,
    pub air: &'a AirKerma,
    /// The detector.
    pub raster: Raster,
}

/// An image scorer that also counts the dose.
pub(crate) struct DoseScore<'a, I> {
    image: I,
    target: &'a DoseTarget<'a>,
    /// Sums since the scorer was made.
    sums: DoseSums,
    /// (voxel, energy steps) deposited by the history in each slot.
    slots: Vec<Vec<(usize, u64)>>,
    /// Energy steps of one history by material; zero between histories.
    materials: Vec<u64>,
    /// Energy steps of one history by region.
    regions: Vec<u64>,
    /// Energy steps of one history by label.
    labels: Vec<u64>,
}

impl<'a, I: Score> DoseScore<'a, I> {
    pub fn new(image: I, target: &'a DoseTarget<'a>) -> Self {
        let (materials, regions) = (target.phantom.materials().len(), target.regions.len());
        let labels = target.labels.as_ref();
        let labels = labels.map_or(0, |(_, numbers)| numbers.count());
        Self {
            image,
            target,
            sums: DoseSums::new(materials, regions, labels),
            slots: Vec::new(),
            materials: vec![0; materials],
            regions: vec![0; regions],
            labels: vec![0; labels],
        }
    }

    /// Adds all counts to the tally; all histories must have ended.
    pub fn hand_in(self) {
        self.target.tally.hand_in(&self.sums);
    }
}

impl<I: Score> Score for DoseScore<'_, I> {
    #[inline]
    fn emit(&mut self, slot: usize, energy_kev: f64) {
        if slot >= self.slots.len() {
            self.slots.resize_with(slot + 1, Vec::new);
        }
        self.image.emit(slot, energy_kev);
    }

    #[inline]
    fn deposit(&mut self, slot: usize, voxel: usize, energy_kev: f64) {
        let steps = nearest(energy_kev * STEPS_PER_KEV);
        let deposits = &mut self.slots[slot];
        match deposits.iter_mut().find(|(other, _)| *other == voxel) {
            Some((_, sum)) => *sum += steps,
            None => deposits.push((voxel, steps)),
        }
        self.image.deposit(slot, voxel, energy_kev);
    }

    #[inline]
    fn arrive(&mut self, slot: usize, arrival: &Arrival, rng: &mut Philox) {
        let Arrival { x_mm, y_mm, .. } = *arrival;
        if self.target.raster.cell_at(x_mm, y_mm).is_some() {
            let cos = arrival.direction.z;
            let cos = if cos < GRAZING_COS {
                0.5 * GRAZING_COS
            } else {
                cos
            };
            let kerma = self.target.air.kev_cm2_g(arrival.energy_kev) / cos;
            self.sums
                .detector_kerma
                .count(nearest(kerma * STEPS_PER_KEV));
        }
        self.image.arrive(slot, arrival, rng);
    }

    #[inline]
    fn escape(&mut self, slot: usize, energy_kev: f64) {
        self.image.escape(slot, energy_kev);
    }

    fn finish(&mut self, slot: usize) {
        let deposits = &mut self.slots[slot];
        if !deposits.is_empty() {
            let DoseTarget {
                phantom,
                regions,
                labels,
                tally,
                ..
            } = self.target;
            let places = !regions.is_empty() || tally.counts_voxels();
            let mut all = 0;
            for (voxel, steps) in deposits.drain(..) {
                all += steps;
                self.materials[usize::from(phantom.material()[voxel])] += steps;
                if let Some((labels, numbers)) = labels
                    && let Some(number) = numbers.get(labels[voxel])
                {
                    self.labels[number] += steps;
                }
                if places {
                    let voxel = phantom.grid().voxel(voxel);
                    tally.score_voxel(voxel, steps);
                    for (region, sum) in regions.iter().zip(&mut self.regions) {
                        if region.index(voxel).is_some() {
                            *sum += steps;
                        }
                    }
                }
            }
            self.sums.phantom.count(all);
            take_into(&mut self.sums.materials, &mut self.materials);
            take_into(&mut self.sums.regions, &mut self.regions);
            take_into(&mut self.sums.labels, &mut self.labels);
        }
        self.image.finish(slot);
    }
}

/// Adds the deposits of one history to the sums and clears them.
fn take_into(sums: &mut [Sum], steps: &mut [u64]) {
    for (sum, steps) in sums.iter_mut().zip(steps) {
        if *steps > 0 {
            sum.count(std::mem::take(steps));
        }
    }
}
