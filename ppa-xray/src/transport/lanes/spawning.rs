//! Puts photons from the source into the lanes of ended histories.

use ppa_core::random::Philox;

use crate::matter::energy_range::CUTOFF_KEV;
use crate::transport::lanes::draws::Depths;
use crate::transport::lanes::entry::{Aim, Enter, Place};
use crate::transport::lanes::flights::{Each, Flights, LANES, each};
use crate::transport::lanes::picked::Picked;
use crate::transport::lanes::plain_beam::PlainBeam;
use crate::transport::lanes::{Lanes, Photon};
use crate::transport::score::Score;
use crate::transport::stream::Stream;
use crate::transport::tally::Category;

/// Photons that have left the source and wait for a free lane.
pub(super) struct Waiting {
    pub flights: Flights,
    pub photons: Each<Photon>,
    /// Whether the photon meets the box.
    pub meets: Each<u32>,
    pub next: usize,
    pub count: usize,
}

impl Lanes<'_, '_> {
    /// Fills the lanes of ended histories; compacts the lanes at the end of the range.
    pub(super) fn replace(&mut self, ended: &Picked, score: &mut impl Score) {
        let mut empty = Picked::new();
        for lane in ended.iter() {
            let filled = self.spawn(lane, score);
            empty.push_if(lane, !filled);
        }
        if empty.count > 0 {
            self.compact(&mut empty);
        }
    }

    /// Moves the last photons into the `empty` lanes.
    #[cold]
    fn compact(&mut self, empty: &mut Picked) {
        empty.lanes[..empty.count].sort_unstable();
        for lane in empty.iter().rev() {
            self.count -= 1;
            let last = self.count;
            let slot = self.photons[lane].slot;
            self.flights.put(lane, self.flights.at(last));
            self.photons[lane] = self.photons[last];
            self.photons[last].slot = slot;
        }
    }

    /// Puts the next photon that meets the box into `lane`; returns false once the range is used up.
    pub(super) fn spawn(&mut self, lane: usize, score: &mut impl Score) -> bool {
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
                let distance_mm = flights.to_plane_mm[next];
                self.exit(&photon, position, direction, distance_mm, score);
            } else {
                self.photons[lane] = photon;
                self.flights.put(lane, flights.at(next));
                return true;
            }
        }
    }

    /// Emits the next photons of the range; returns false once it is used up.
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
        self.leave_source(first, count);
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

    /// Samples directions and energies of waiting photons from the first random block of each.
    fn leave_source(&mut self, first: u64, count: usize) {
        let transport = self.transport;
        let mut kept = [0; LANES];
        let plain = transport.plain_beam();
        if plain.is_some() {
            let field = transport.emitter.field();
            self.isa.run(PlainBeam {
                low_mm: field.low_mm.map(|low| low as f32),
                size_mm: field.size_mm().map(|size| size as f32),
                distance_mm: self.space.source_detector_mm,
                words: &self.draws.block,
                flights: &mut self.waiting.flights,
                kept: &mut kept,
                count: count.next_multiple_of(16),
            });
        }
        for (i, kept) in kept.into_iter().enumerate().take(count) {
            let history = first + i as u64;
            let (energy_kev, step) = match plain {
                Some(spectrum) if kept != 0 => {
                    let word = self.draws.block[3][i];
                    (
                        spectrum.sample(f64::from(word) * (1.0 / 4_294_967_296.0)),
                        1,
                    )
                }
                _ => {
                    let mut rng = Philox::at(self.seed, Stream::History as u32, history, 1);
                    if plain.is_none() {
                        rng = rng.after(self.draws.block(i));
                    }
                    let emission = transport.emit(&mut rng);
                    for axis in 0..3 {
                        let flights = &mut self.waiting.flights;
                        flights.direction[axis][i] = emission.direction[axis] as f32;
                        flights.position[axis][i] = emission.origin_mm[axis] as f32;
                    }
                    (emission.energy_kev, rng.step())
                }
            };
            let energy = transport.tables.attenuation.locate(energy_kev);
            self.waiting.photons[i] = Photon {
                history,
                step,
                row: transport.tables.majorants().row(energy),
                energy_kev: energy_kev as f32,
                energy,
                category: Category::Primary,
                slot: 0,
            };
        }
    }
}
