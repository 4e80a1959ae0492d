//! Many histories at once: the arithmetic of all flights is vector code, tables and decisions are taken photon by photon.
//!
//! Every round takes each flight one step: to the wall of the cube over which its bound holds, or to a tentative collision.
//! A photon whose history ends makes room for the next one. The random numbers of a history depend on nothing but the
//! seed and its index, so the company it travels in changes nothing.

mod elementary;
mod isa;
mod kernels;

use std::ops::Range;

use nalgebra::{Matrix4, Vector3};

use crate::beam::emitter::Emission;
use crate::philox::Philox;
use crate::transport::attenuation::{CUTOFF_KEV, EnergyNode};
use crate::transport::lanes::isa::Isa;
use crate::transport::lanes::kernels::{
    Advance, Aim, Blocks, Box32, Depths, Draw, Draws, Each, Enter, Flights, Locate, Steps, Turn,
    Turns, each, unit,
};
use crate::transport::majorants::Region;
use crate::transport::score::{Arrival, Score};
use crate::transport::stream::Stream;
use crate::transport::tally::Category;
use crate::transport::tracking::Transport;

pub(crate) use kernels::LANES;

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

/// Photons that have left the source and wait for a lane.
struct Waiting {
    flights: Flights,
    photons: Each<Photon>,
    /// Whether the photon meets the box.
    meets: Each<u32>,
    next: usize,
    count: usize,
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
}

/// A list of lanes.
struct Picked {
    lanes: [u8; LANES],
    count: usize,
}

impl Picked {
    fn new() -> Self {
        Self {
            lanes: [0; LANES],
            count: 0,
        }
    }

    /// Appends `lane` if `wanted`, without a branch.
    #[inline(always)]
    fn push_if(&mut self, lane: usize, wanted: bool) {
        self.lanes[self.count % LANES] = lane as u8;
        self.count += usize::from(wanted);
    }

    #[inline(always)]
    fn iter(&self) -> impl DoubleEndedIterator<Item = usize> + ExactSizeIterator + '_ {
        self.lanes[..self.count]
            .iter()
            .map(|&lane| usize::from(lane) % LANES)
    }
}

/// Follows `histories` of `seed` and tells `score` what they leave; slots are below [`LANES`].
pub(super) fn follow(
    transport: &Transport,
    seed: u64,
    histories: Range<u64>,
    score: &mut impl Score,
) {
    Lanes::new(transport, Isa::widest(), seed, histories).run(score);
}

impl<'a, 'p> Lanes<'a, 'p> {
    fn new(transport: &'a Transport<'p>, isa: Isa, seed: u64, remaining: Range<u64>) -> Self {
        let cell_from_mm = transport.lattice.cell_from_device();
        let mm_from_cell = transport.lattice.device_from_cell();
        let row = |matrix: &Matrix4<f64>, row: usize| {
            [0, 1, 2, 3].map(|column| matrix[(row, column)] as f32)
        };
        let blocks = transport.majorants.blocks;
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
            draws: Draws::new(),
        }
    }

    fn run(mut self, score: &mut impl Score) {
        let mut blocks = Blocks::new();
        let mut steps = Steps::new();
        while self.count < LANES && self.board(self.count, score) {
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
            self.replace(&mut ended, score);
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
        let majorants = &self.transport.majorants;
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
        self.draws.counter[3] = [Stream::History as u32; LANES];
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

    /// Accepts or rejects tentative collisions and carries out the accepted ones.
    fn collide(
        &mut self,
        tentative: &Picked,
        ended: &mut Picked,
        blocks: &Blocks,
        steps: &Steps,
        score: &mut impl Score,
    ) {
        self.draw(tentative);
        let mut depths = [0.0; LANES];
        self.isa.run(Depths {
            word: &self.draws.block[1],
            depth: &mut depths,
            count: tentative.count.next_multiple_of(16),
        });
        let mut scattered = Picked::new();
        let mut turns = Turns::new();
        let mut by = [Coupling::Rayleigh; LANES];
        let size = self.transport.lattice.size;
        for (i, lane) in tentative.iter().enumerate() {
            let photon = &self.photons[lane];
            let [x, y, z] = each(&steps.voxel, lane);
            let voxel = x as usize + size[0] * (y as usize + size[1] * z as usize);
            let code = self.transport.codes[voxel];
            let sums = self
                .transport
                .attenuation
                .at(code.material(), photon.energy);
            let density = code.density_g_cm3();
            let lot = unit(self.draws.block[0][i]) * blocks.bound[lane];
            self.flights.depth[lane] = depths[i];
            if lot >= density * sums.total {
                continue;
            }
            if lot < density * sums.photoelectric {
                let energy_kev = f64::from(photon.energy_kev);
                score.deposit(usize::from(photon.slot), voxel, energy_kev);
                score.finish(usize::from(photon.slot));
                ended.push_if(lane, true);
                continue;
            }
            by[scattered.count] = if lot < density * sums.with_compton {
                Coupling::Compton
            } else {
                Coupling::Rayleigh
            };
            turns.azimuth[scattered.count] = self.draws.block[2][i];
            scattered.push_if(lane, true);
        }
        if scattered.count > 0 {
            self.scatter(&scattered, &by, &mut turns, ended, steps, score);
        }
    }

    fn scatter(
        &mut self,
        scattered: &Picked,
        by: &Each<Coupling>,
        turns: &mut Turns,
        ended: &mut Picked,
        steps: &Steps,
        score: &mut impl Score,
    ) {
        self.draw(scattered);
        let size = self.transport.lattice.size;
        for (i, lane) in scattered.iter().enumerate() {
            let photon = &mut self.photons[lane];
            let [x, y, z] = each(&steps.voxel, lane);
            let voxel = x as usize + size[0] * (y as usize + size[1] * z as usize);
            let material = self.transport.codes[voxel].material();
            let tables = &self.transport.samplers[usize::from(material)];
            let mut rng = Philox::at(
                self.seed,
                Stream::History as u32,
                photon.history,
                photon.step,
            )
            .after(self.draws.block(i));
            let before_kev = f64::from(photon.energy_kev);
            turns.cos_theta[i] = match by[i] {
                Coupling::Compton => {
                    let (cos_theta, energy_kev) = tables.sample_compton(before_kev, &mut rng);
                    photon.energy_kev = energy_kev as f32;
                    cos_theta as f32
                }
                Coupling::Rayleigh => tables.sample_rayleigh(before_kev, &mut rng) as f32,
            };
            photon.step = rng.step();
            photon.category = match photon.category {
                Category::Primary => by[i].category(),
                _ => Category::Multiple,
            };
            for axis in 0..3 {
                turns.direction[axis][i] = self.flights.direction[axis][lane];
            }
            if by[i] == Coupling::Rayleigh {
                continue;
            }
            let slot = usize::from(photon.slot);
            if f64::from(photon.energy_kev) < CUTOFF_KEV {
                // What is left of the photon stays here too.
                score.deposit(slot, voxel, before_kev);
                score.finish(slot);
                ended.push_if(lane, true);
            } else {
                score.deposit(slot, voxel, before_kev - f64::from(photon.energy_kev));
                photon.energy = self.transport.attenuation.locate(photon.energy_kev.into());
                photon.row = self.transport.majorants.row(photon.energy);
            }
        }
        let count = scattered.count.next_multiple_of(16);
        self.isa.run(Turn { turns, count });
        let mut flights = Flights::new();
        for (i, lane) in scattered.iter().enumerate() {
            for axis in 0..3 {
                flights.direction[axis][i] = turns.direction[axis][i];
                flights.position[axis][i] = self.flights.position[axis][lane];
            }
            flights.depth[i] = self.flights.depth[lane];
        }
        self.isa.run(Aim {
            space: &self.space,
            flights: &mut flights,
            count,
        });
        for (i, lane) in scattered.iter().enumerate() {
            self.flights.copy(lane, &flights, i);
        }
    }

    /// The flight in `lane` has left the box or met the detector plane.
    fn leave(&mut self, lane: usize, score: &mut impl Score) {
        let position = each(&self.flights.position, lane);
        let direction = each(&self.flights.direction, lane);
        self.exit(
            &self.photons[lane],
            position,
            direction,
            self.flights.to_plane_mm[lane],
            score,
        );
    }

    /// Brings a photon from the edge of the box to the detector plane, or lets it go.
    #[inline(always)]
    fn exit(
        &self,
        photon: &Photon,
        position: [f32; 3],
        direction: [f32; 3],
        to_plane_mm: f32,
        score: &mut impl Score,
    ) {
        let slot = usize::from(photon.slot);
        let energy_kev = f64::from(photon.energy_kev);
        if to_plane_mm.is_finite() {
            let way = f64::from(to_plane_mm);
            let direction = Vector3::from(direction.map(f64::from));
            let [x, y, z] = position.map(f64::from);
            let m = &self.mm_from_cell;
            let mm = |row: usize| m[(row, 0)] * x + m[(row, 1)] * y + m[(row, 2)] * z + m[(row, 3)];
            let arrival = Arrival {
                x_mm: mm(0) + direction.x * way,
                y_mm: mm(1) + direction.y * way,
                direction,
                energy_kev,
                category: photon.category,
            };
            score.arrive(slot, &arrival, &mut self.generator(photon));
        } else {
            score.escape(slot, energy_kev);
        }
        score.finish(slot);
    }

    /// Fills the lanes of ended histories; at the end of the range, closes up.
    fn replace(&mut self, ended: &mut Picked, score: &mut impl Score) {
        let count = ended.count;
        ended.lanes[..count].sort_unstable();
        for lane in ended.iter().rev() {
            if !self.board(lane, score) {
                self.count -= 1;
                let last = self.count;
                let slot = self.photons[lane].slot;
                let flights = &mut self.flights;
                for axis in 0..3 {
                    flights.position[axis][lane] = flights.position[axis][last];
                    flights.direction[axis][lane] = flights.direction[axis][last];
                    flights.slope[axis][lane] = flights.slope[axis][last];
                    flights.inverse[axis][lane] = flights.inverse[axis][last];
                }
                flights.depth[lane] = flights.depth[last];
                flights.to_plane_mm[lane] = flights.to_plane_mm[last];
                self.photons[lane] = self.photons[last];
                self.photons[last].slot = slot;
            }
        }
    }

    /// Puts the next photon that meets the box into `lane`; false once the range is used up.
    fn board(&mut self, lane: usize, score: &mut impl Score) -> bool {
        let slot = self.photons[lane].slot;
        loop {
            if self.waiting.next == self.waiting.count && !self.emit() {
                return false;
            }
            let next = self.waiting.next;
            self.waiting.next += 1;
            let photon = Photon {
                slot,
                ..self.waiting.photons[next]
            };
            score.emit(usize::from(slot), f64::from(photon.energy_kev));
            let flights = &self.waiting.flights;
            if f64::from(photon.energy_kev) < CUTOFF_KEV {
                score.escape(usize::from(slot), f64::from(photon.energy_kev));
                score.finish(usize::from(slot));
            } else if self.waiting.meets[next] == 0 {
                let position = each(&flights.position, next);
                let direction = each(&flights.direction, next);
                let way = flights.to_plane_mm[next];
                self.exit(&photon, position, direction, way, score);
            } else {
                self.photons[lane] = photon;
                self.flights.copy(lane, flights, next);
                return true;
            }
        }
    }

    /// Emits the next photons of the range; false once it is used up.
    fn emit(&mut self) -> bool {
        let first = self.remaining.start;
        let count = (self.remaining.end - first).min(LANES as u64) as usize;
        if count == 0 {
            return false;
        }
        self.remaining.start += count as u64;
        for i in 0..count {
            let history = first + i as u64;
            self.draws.counter[0][i] = history as u32;
            self.draws.counter[1][i] = (history >> 32) as u32;
            self.draws.counter[2][i] = 0;
        }
        self.philox(count);
        let emitter = &self.transport.emitter;
        let cell_from_mm = self.transport.lattice.cell_from_device();
        for i in 0..count {
            let history = first + i as u64;
            let mut rng = Philox::at(self.seed, Stream::History as u32, history, 1)
                .after(self.draws.block(i));
            let Emission {
                origin_mm,
                direction,
                energy_kev,
            } = emitter.emit(&mut rng);
            let origin = cell_from_mm.transform_point(&origin_mm);
            for axis in 0..3 {
                self.waiting.flights.direction[axis][i] = direction[axis] as f32;
                self.waiting.flights.position[axis][i] = origin[axis] as f32;
            }
            let energy = self.transport.attenuation.locate(energy_kev);
            self.waiting.photons[i] = Photon {
                history,
                step: rng.step(),
                row: self.transport.majorants.row(energy),
                energy_kev: energy_kev as f32,
                energy,
                category: Category::Primary,
                slot: 0,
            };
        }
        for i in 0..count {
            self.draws.counter[2][i] = self.waiting.photons[i].step;
            self.waiting.photons[i].step += 1;
        }
        self.philox(count);
        let padded = count.next_multiple_of(16);
        self.isa.run(Aim {
            space: &self.space,
            flights: &mut self.waiting.flights,
            count: padded,
        });
        self.isa.run(Enter {
            space: &self.space,
            flights: &mut self.waiting.flights,
            meets: &mut self.waiting.meets,
            count: padded,
        });
        self.isa.run(Depths {
            word: &self.draws.block[0],
            depth: &mut self.waiting.flights.depth,
            count: padded,
        });
        (self.waiting.next, self.waiting.count) = (0, count);
        true
    }
}

/// The two ways to scatter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Coupling {
    Compton,
    Rayleigh,
}

impl Coupling {
    fn category(self) -> Category {
        match self {
            Self::Compton => Category::Compton,
            Self::Rayleigh => Category::Rayleigh,
        }
    }
}

#[cfg(test)]
mod tests;
