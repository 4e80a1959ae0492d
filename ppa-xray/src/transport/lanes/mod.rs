//! Follows many histories at once: the arithmetic of all flights is vector code, tables and decisions are handled photon by photon.
//!
//! Every round advances each flight by one step: to the wall of the cube over which its bound is valid, or to a tentative collision.
//! A photon whose history ends is replaced by the next one. The random numbers of a history depend only on the
//! seed and its index, so histories do not affect each other.

mod advance;
mod collisions;
mod compton_attempt;
mod draws;
mod entry;
mod exits;
mod flights;
mod picked;
mod plain_beam;
mod rotation;
mod scattering;
mod spawning;

use std::ops::Range;

use nalgebra::Matrix4;
use ppa_core::random::Philox;

use crate::isa::Isa;
use crate::transport::attenuation::EnergyNode;
use crate::transport::lanes::advance::{Advance, Blocks, Locate, Steps};
use crate::transport::lanes::draws::{Draw, Draws};
use crate::transport::lanes::flights::{Box32, Each, Flights};
use crate::transport::lanes::picked::Picked;
use crate::transport::lanes::scattering::Scattering;
use crate::transport::lanes::spawning::Waiting;
use crate::transport::majorants::Region;
use crate::transport::score::Score;
use crate::transport::stream::Stream;
use crate::transport::tally::Category;
use crate::transport::tracking::Transport;

pub(crate) use flights::LANES;

/// Properties of a photon other than its flight.
#[derive(Debug, Clone, Copy)]
struct Photon {
    history: u64,
    /// Random blocks used so far.
    step: u32,
    /// Row of bounds at its energy.
    row: u32,
    energy_kev: f32,
    energy: EnergyNode,
    category: Category,
    /// Slot of the scorer.
    slot: u8,
}

/// Running histories of a range.
struct Lanes<'a, 'p> {
    transport: &'a Transport<'p>,
    space: Box32,
    mm_from_cell: Matrix4<f64>,
    isa: Isa,
    seed: u64,
    remaining: Range<u64>,
    waiting: Waiting,
    flights: Flights,
    photons: Each<Photon>,
    /// Number of lanes in use; they come first.
    count: usize,
    draws: Draws,
    scattering: Scattering,
}

impl Transport<'_> {
    /// Follows the `histories` of a seed and reports their events to `score`; slots are below [`LANES`].
    ///
    /// Each history is independent of the others followed at the same time: any split of a range gives the same events, in another order.
    pub fn follow(&self, seed: u64, histories: Range<u64>, score: &mut impl Score) {
        follow(self, seed, histories, score);
    }
}

/// Follows `histories` of `seed` and reports their events to `score`; slots are below [`LANES`].
fn follow(transport: &Transport, seed: u64, histories: Range<u64>, score: &mut impl Score) {
    Lanes::new(transport, Isa::widest(), seed, histories).run(score);
}

impl<'a, 'p> Lanes<'a, 'p> {
    fn new(transport: &'a Transport<'p>, isa: Isa, seed: u64, remaining: Range<u64>) -> Self {
        let cell_from_mm = transport.lattice.cell_from_device();
        let mm_from_cell = transport.lattice.device_from_cell();
        let row = |matrix: &Matrix4<f64>, row: usize| {
            [0, 1, 2, 3].map(|column| matrix[(row, column)] as f32)
        };
        let blocks = transport.tables.majorants().blocks;
        let idle = Photon {
            history: 0,
            step: 0,
            row: 0,
            energy_kev: 0.0,
            energy: EnergyNode::default(),
            category: Category::Primary,
            slot: 0,
        };
        Self {
            space: Box32 {
                cell_from_device: [0, 1, 2].map(|axis| row(&cell_from_mm, axis)),
                device_z: row(&mm_from_cell, 2),
                source_detector_mm: transport.projection.source_detector_mm as f32,
                size: transport.lattice.size.map(|n| n as f32),
                blocks,
                edge: transport.tables.majorants().edge as f32,
            },
            mm_from_cell,
            transport,
            isa,
            seed,
            remaining,
            waiting: Waiting {
                flights: Flights::new(),
                photons: [idle; LANES],
                meets: [0; LANES],
                next: 0,
                count: 0,
            },
            flights: Flights::new(),
            photons: std::array::from_fn(|lane| Photon {
                slot: lane as u8,
                ..idle
            }),
            count: 0,
            draws: Draws::new(Stream::History),
            scattering: Scattering::new(),
        }
    }

    fn run(mut self, score: &mut impl Score) {
        let mut blocks = Blocks::new();
        let mut steps = Steps::new();
        while self.count < LANES && self.spawn(self.count, score) {
            self.count += 1;
        }
        while self.count > 0 {
            self.step(&mut blocks, &mut steps);
            let (mut tentative, mut ended) = (Picked::new(), Picked::new());
            for lane in 0..self.count {
                tentative.push_if(lane, steps.outcome[lane] == Steps::TENTATIVE);
                ended.push_if(lane, steps.outcome[lane] == Steps::OUT);
            }
            for lane in ended.iter() {
                self.leave(lane, score);
            }
            if tentative.count > 0 {
                self.collide(&tentative, &mut ended, &blocks, &steps, score);
            }
            self.replace(&ended, score);
        }
    }

    /// Advances every flight by one step.
    fn step(&mut self, blocks: &mut Blocks, steps: &mut Steps) {
        // Round up to whole vectors: lanes beyond the last photon hold old, harmless numbers.
        let count = self.count.next_multiple_of(16);
        self.isa.run(Locate {
            space: &self.space,
            flights: &self.flights,
            blocks,
            count,
        });
        let majorants = &self.transport.tables.majorants();
        for lane in 0..self.count {
            let region: Region = majorants.region(blocks.index[lane]);
            blocks.reach[lane] = f32::from(region.reach);
            blocks.bound[lane] = majorants.bound(self.photons[lane].row, region);
        }
        self.isa.run(Advance {
            space: &self.space,
            flights: &mut self.flights,
            blocks,
            steps,
            count,
        });
    }

    /// Draws the next random block of the histories in `lanes`.
    fn draw(&mut self, lanes: &Picked) {
        for (i, lane) in lanes.iter().enumerate() {
            let photon = &mut self.photons[lane];
            self.draws.counter[0][i] = photon.history as u32;
            self.draws.counter[1][i] = (photon.history >> 32) as u32;
            self.draws.counter[2][i] = photon.step;
            photon.step += 1;
        }
        self.philox(lanes.count);
    }

    /// Random blocks of the first `count` counters.
    fn philox(&mut self, count: usize) {
        self.isa.run(Draw {
            key: Philox::key(self.seed),
            draws: &mut self.draws,
            count: count.next_multiple_of(16),
        });
    }

    /// Returns the generator of a history whose next block is number `step`.
    fn generator(&self, photon: &Photon) -> Philox {
        Philox::at(
            self.seed,
            Stream::History as u32,
            photon.history,
            photon.step,
        )
    }
}

#[cfg(test)]
mod tests;
