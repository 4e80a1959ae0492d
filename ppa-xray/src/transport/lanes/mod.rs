//! Many histories at once: the arithmetic of all flights is vector code, tables and decisions are taken photon by photon.
//!
//! Every round takes each flight one step: to the wall of the cube over which its bound holds, or to a tentative collision.
//! A photon whose history ends makes room for the next one. The random numbers of a history depend on nothing but the
//! seed and its index, so the histories that run alongside it change nothing.

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

/// What a photon is, besides where it flies.
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

/// The histories of a range, under way.
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
    /// Lanes in use; they come first.
    count: usize,
    draws: Draws,
    scattering: Scattering,
}

impl Transport<'_> {
    /// Follows the `histories` of a seed and reports to `score` what they leave; slots are below [`LANES`].
    ///
    /// Each history is the same whatever runs beside it: any split of a range leaves the same events, in another order.
    pub fn follow(&self, seed: u64, histories: Range<u64>, score: &mut impl Score) {
        follow(self, seed, histories, score);
    }
}

/// Follows `histories` of `seed` and reports to `score` what they leave; slots are below [`LANES`].
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

    /// One step of every flight.
    fn step(&mut self, blocks: &mut Blocks, steps: &mut Steps) {
        // Whole vectors: lanes beyond the last photon hold old, harmless numbers.
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

    /// Generator of a history whose next block is number `step`.
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
