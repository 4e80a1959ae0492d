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
    Advance, Aim, Attempt, Attempts, Blocks, Box32, Depths, Draw, Draws, Each, Enter, Flights,
    Locate, Place, Steps, Turn, Turns, each, unit,
};
use crate::transport::majorants::Region;
use crate::transport::score::{Arrival, Score};
use crate::transport::stream::Stream;
use crate::transport::tally::Category;
use crate::transport::tracking::Transport;
use crate::transport::voxel_codes::VoxelCode;

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

/// Where a tentative collision takes place.
#[derive(Debug, Clone, Copy, Default)]
struct Site {
    lane: u8,
    voxel: usize,
    code: VoxelCode,
}

impl Site {
    #[inline(always)]
    fn lane(&self) -> usize {
        usize::from(self.lane) % LANES
    }
}

impl Photon {
    #[inline(always)]
    fn scatter(&mut self, by: Category) {
        self.category = match self.category {
            Category::Primary => by,
            _ => Category::Multiple,
        };
    }
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
        let mut site = [Site::default(); LANES];
        let size = self.transport.lattice.size;
        for (site, lane) in site.iter_mut().zip(tentative.iter()) {
            let [x, y, z] = each(&steps.voxel, lane);
            let voxel = x as usize + size[0] * (y as usize + size[1] * z as usize);
            *site = Site {
                lane: lane as u8,
                voxel,
                code: self.transport.codes[voxel],
            };
        }
        self.draw(tentative);
        let mut depths = [0.0; LANES];
        self.isa.run(Depths {
            word: &self.draws.block[1],
            depth: &mut depths,
            count: tentative.count.next_multiple_of(16),
        });
        let (mut compton, mut rayleigh) = (Picked::new(), Picked::new());
        for (i, lane) in tentative.iter().enumerate() {
            let photon = &self.photons[lane];
            let code = site[i].code;
            let sums = self
                .transport
                .attenuation
                .at(code.material(), photon.energy);
            let density = code.density_g_cm3();
            let lot = unit(self.draws.block[0][i]) * blocks.bound[lane];
            self.flights.depth[lane] = depths[i];
            let absorbed = lot < density * sums.photoelectric;
            let not_rayleigh = lot < density * sums.with_compton;
            compton.push_if(i, not_rayleigh & !absorbed);
            rayleigh.push_if(i, (lot < density * sums.total) & !not_rayleigh);
            if absorbed {
                let slot = usize::from(photon.slot);
                score.deposit(slot, site[i].voxel, f64::from(photon.energy_kev));
                score.finish(slot);
                ended.push_if(lane, true);
            }
        }
        let sites = compton.iter().chain(rayleigh.iter());
        let mut turns = Turns::new();
        let mut scattered = [Site::default(); LANES];
        for (n, i) in sites.enumerate() {
            scattered[n] = site[i];
            turns.azimuth[n] = self.draws.block[2][i];
        }
        let scattered = &scattered[..compton.count + rayleigh.count];
        if !scattered.is_empty() {
            self.scatter(scattered, compton.count, &mut turns, ended, score);
        }
    }

    /// Scatters photons: the first `compton` of them off electrons, the others off whole atoms.
    fn scatter(
        &mut self,
        scattered: &[Site],
        compton: usize,
        turns: &mut Turns,
        ended: &mut Picked,
        score: &mut impl Score,
    ) {
        let mut lanes = Picked::new();
        for (n, site) in scattered.iter().enumerate() {
            let lane = site.lane();
            lanes.push_if(lane, true);
            let direction = each(&self.flights.direction, lane);
            for (to, from) in turns.direction.iter_mut().zip(direction) {
                to[n] = from;
            }
        }
        self.draw(&lanes);
        let attempts = self.attempt_compton(&scattered[..compton]);
        for (n, site) in scattered[..compton].iter().enumerate() {
            let (half, scattered_kev) = self.compton(site, &attempts, n);
            turns.cos_theta[n] = 1.0 - 2.0 * half;
            let photon = &mut self.photons[site.lane()];
            let slot = usize::from(photon.slot);
            let before_kev = f64::from(photon.energy_kev);
            photon.energy_kev = scattered_kev;
            photon.scatter(Category::Compton);
            if f64::from(scattered_kev) < CUTOFF_KEV {
                // What is left of the photon stays here too.
                score.deposit(slot, site.voxel, before_kev);
                score.finish(slot);
                ended.push_if(site.lane(), true);
            } else {
                score.deposit(slot, site.voxel, before_kev - f64::from(scattered_kev));
                photon.energy = self.transport.attenuation.locate(scattered_kev.into());
                photon.row = self.transport.majorants.row(photon.energy);
            }
        }
        for (n, site) in scattered.iter().enumerate().skip(compton) {
            let photon = &self.photons[site.lane()];
            let mut rng = self.generator(photon).after(self.draws.block(n));
            let tables = &self.transport.samplers[usize::from(site.code.material())];
            let cos_theta = tables.sample_rayleigh(photon.energy_kev.into(), &mut rng);
            turns.cos_theta[n] = cos_theta as f32;
            let photon = &mut self.photons[site.lane()];
            photon.step = rng.step();
            photon.scatter(Category::Rayleigh);
        }
        let count = scattered.len().next_multiple_of(16);
        self.isa.run(Turn { turns, count });
        let mut flights = Flights::new();
        flights.direction = turns.direction;
        for (n, site) in scattered.iter().enumerate() {
            let position = each(&self.flights.position, site.lane());
            for (to, from) in flights.position.iter_mut().zip(position) {
                to[n] = from;
            }
            flights.depth[n] = self.flights.depth[site.lane()];
        }
        self.isa.run(Aim {
            space: &self.space,
            flights: &mut flights,
            count,
        });
        for (n, site) in scattered.iter().enumerate() {
            self.flights.copy(site.lane(), &flights, n);
        }
    }

    /// One attempt at each Compton scattering, if the tables of its material let attempts be made together.
    fn attempt_compton(&self, sites: &[Site]) -> Attempts {
        let mut attempts = Attempts::new();
        for (n, site) in sites.iter().enumerate() {
            let energy_kev = self.photons[site.lane()].energy_kev;
            let tables = &self.transport.samplers[usize::from(site.code.material())];
            let [angle, shell, ..] = self.draws.block(n);
            if let Some((half, electron)) =
                tables.attempt_compton(energy_kev, unit(angle), unit(shell))
            {
                attempts.energy_kev[n] = energy_kev;
                attempts.half[n] = half;
                attempts.binding_kev[n] = electron.binding_kev;
                attempts.momentum[n] = electron.momentum;
            }
        }
        self.isa.run(Attempt {
            attempts: &mut attempts,
            momentum: &self.draws.block[2],
            way: &self.draws.block[3],
            count: sites.len().next_multiple_of(16),
        });
        attempts
    }

    /// sin²(θ/2) and the energy in keV after Compton scattering; what an attempt leaves open is drawn anew.
    #[inline(always)]
    fn compton(&mut self, site: &Site, attempts: &Attempts, n: usize) -> (f32, f32) {
        let half = attempts.half[n];
        let scattered_kev = attempts.scattered_kev[n];
        if scattered_kev > 0.0 {
            return (half, scattered_kev);
        }
        self.compton_anew(site, (scattered_kev == 0.0).then_some(half))
    }

    #[cold]
    #[inline(never)]
    fn compton_anew(&mut self, site: &Site, half: Option<f32>) -> (f32, f32) {
        let photon = &self.photons[site.lane()];
        let energy_kev = f64::from(photon.energy_kev);
        let mut rng = self.generator(photon);
        let tables = &self.transport.samplers[usize::from(site.code.material())];
        let (cos_theta, scattered_kev) = match half {
            Some(half) => {
                let cos_theta = 1.0 - 2.0 * f64::from(half);
                let scattered_kev = tables.compton_energy_at(energy_kev, cos_theta, || rng.unit());
                (cos_theta, scattered_kev)
            }
            None => tables.sample_compton(energy_kev, &mut rng),
        };
        self.photons[site.lane()].step = rng.step();
        ((0.5 * (1.0 - cos_theta)) as f32, scattered_kev as f32)
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
    fn replace(&mut self, ended: &Picked, score: &mut impl Score) {
        let mut empty = Picked::new();
        for lane in ended.iter() {
            let filled = self.board(lane, score);
            empty.push_if(lane, !filled);
        }
        if empty.count > 0 {
            self.close_up(&mut empty);
        }
    }

    /// Moves the last photons into the `empty` lanes.
    #[cold]
    fn close_up(&mut self, empty: &mut Picked) {
        empty.lanes[..empty.count].sort_unstable();
        for lane in empty.iter().rev() {
            self.count -= 1;
            let last = self.count;
            let slot = self.photons[lane].slot;
            self.flights.move_within(lane, last);
            self.photons[lane] = self.photons[last];
            self.photons[last].slot = slot;
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
        for i in 0..count {
            let history = first + i as u64;
            let mut rng = Philox::at(self.seed, Stream::History as u32, history, 1)
                .after(self.draws.block(i));
            let Emission {
                origin_mm,
                direction,
                energy_kev,
            } = emitter.emit(&mut rng);
            for axis in 0..3 {
                self.waiting.flights.direction[axis][i] = direction[axis] as f32;
                self.waiting.flights.position[axis][i] = origin_mm[axis] as f32;
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
        self.isa.run(Place {
            space: &self.space,
            flights: &mut self.waiting.flights,
            count: padded,
        });
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

#[cfg(test)]
mod tests;
