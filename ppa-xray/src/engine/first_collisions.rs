//! Lists of first collisions: positions by importance sampling, forced (expected) attenuation to each, all energies at once.
//!
//! Estimator: the integral over the body of fluence times scattering coefficient, docs/physics.md, "Fast engine", first collisions.

use ppa_core::random::Philox;
use rayon::prelude::*;

use crate::engine::attenuation_basis::BasisMass;
use crate::engine::attenuation_basis::{LANES, dot};
use crate::engine::collision_map::{Collision, CollisionMap};
use crate::engine::fast_progress::{Monitor, PRIMARY_DONE, Phase};
use crate::engine::importance::ImportanceModel;
use crate::engine::lines::{Line, Lines};
use crate::engine::paths::Paths;
use crate::engine::quasi_random::QuasiRandom;
use crate::engine::site::Site;
use crate::transport::stream::Stream;
use crate::transport::tracking::Transport;
use crate::vector_math::{exp, pad};

/// Independent lists, whose spread gives the standard error.
pub(crate) const ESTIMATES: usize = 16;

/// Share of the histories that are distributed equally over all sites.
const ALIKE: f64 = 0.5;

/// First collisions distributed over the irradiated body. For single scatter each point of the detector selects from
/// them; histories of multiple scatter continue from them.
#[derive(Default)]
pub(crate) struct FirstCollisions {
    pub sites: Vec<Site>,
    /// Photons of every line that reach a site, times the mass that it represents, site by site, padded like the lines. Their sum
    /// over a list is an integral over all sites: mm g/cm³ per history.
    photons: Vec<f32>,
    /// Photons that scatter at the sites or are absorbed and followed by a K x-ray, and the cumulative number of histories that start
    /// there.
    secondary: Vec<f64>,
    cdf: Vec<f64>,
}

/// Number of collisions between checks for cancellation.
const CANCEL_EVERY: usize = 1024;

/// Data needed to sample first collisions.
pub(crate) struct FirstFlights<'a> {
    pub transport: &'a Transport<'a>,
    pub paths: &'a Paths<'a>,
    pub lines: &'a Lines,
    pub map: &'a CollisionMap,
    pub importance_model: &'a ImportanceModel<'a>,
}

impl FirstFlights<'_> {
    /// Samples [`ESTIMATES`] lists of `collisions` each; shorter ones once the monitor is cancelled.
    pub fn lists(&self, seed: u64, collisions: u64, monitor: &Monitor) -> Vec<FirstCollisions> {
        let phase = monitor.phase(PRIMARY_DONE..PRIMARY_DONE, 1);
        (0..ESTIMATES as u64)
            .into_par_iter()
            .map(|list| {
                let mut rng = Philox::new(seed, Stream::SingleScatter as u32, list);
                self.list(collisions, &mut rng, &phase)
            })
            .collect()
    }

    fn list(&self, collisions: u64, rng: &mut Philox, phase: &Phase) -> FirstCollisions {
        let goes_on = |n: usize| {
            if n.is_multiple_of(CANCEL_EVERY) {
                phase.advance();
            }
            !phase.is_cancelled()
        };
        let collisions = collisions as usize;
        let mut points = QuasiRandom::<3>::new(rng);
        let mut drawn: Vec<Collision> = Vec::with_capacity(collisions);
        drawn.extend((0..collisions).take_while(|&n| goes_on(n)).map(|_| {
            self.map
                .draw(points.next(), self.transport, self.paths, rng)
        }));
        // Sorted so that neighbours are adjacent: equal steps through the list are then also evenly distributed in space.
        drawn.sort_by_key(|collision| collision.cell);
        let mut list = FirstCollisions::default();
        let mut mass = vec![[0.0; LANES]; self.paths.basis.groups];
        for (_, collision) in drawn.iter().enumerate().take_while(|(n, _)| goes_on(*n)) {
            self.enter(
                collision,
                1.0 / collisions as f64,
                &mut mass,
                &mut list,
                rng,
            );
        }
        list.share_out();
        list
    }

    /// Adds a collision to a list.
    fn enter(
        &self,
        collision: &Collision,
        weight: f64,
        mass: &mut BasisMass,
        list: &mut FirstCollisions,
        rng: &mut Philox,
    ) {
        let Some(cell) = self.paths.cell_at(&collision.position) else {
            return; // on the surface of the box, but for rounding
        };
        let Transport {
            tables, emitter, ..
        } = self.transport;
        let code = tables.draw_code(&cell, rng);
        if !emitter.lights(&collision.spot, collision.aim) {
            return; // the blades cover that point of the spot
        }
        let emitted_per_mm2 = emitter.open_fluence_cm2(&collision.spot, collision.aim) / 100.0;
        let density = f64::from(code.density_g_cm3());
        let weight = weight * emitted_per_mm2 * collision.mm3 * density;
        if weight == 0.0 {
            return; // vacuum
        }
        self.paths
            .between(&collision.spot, &collision.position, mass);
        let material = code.material();
        let mixture = emitter.mixture(&collision.direction);
        let (mut arriving, mut energy, mut secondary) = (0.0, 0.0, 0.0);
        for (line, photons) in self.lines.of(mixture) {
            let through = f64::from(exp(-dot(mass, &line.attenuation)));
            let photons = (weight * photons * through) as f32;
            list.photons.push(photons);
            arriving += f64::from(photons);
            energy += f64::from(photons) * line.energy_kev;
            secondary += f64::from(photons) * line.secondary[usize::from(material)];
        }
        pad(&mut list.photons);
        list.secondary.push(secondary);
        list.sites.push(Site {
            position: collision.position.cast(),
            direction: collision.direction.cast(),
            weight: arriving as f32,
            attenuation_ratio: self
                .importance_model
                .attenuation_ratio(energy / arriving.max(f64::MIN_POSITIVE)),
            material,
        });
    }
}

impl FirstCollisions {
    /// Every line, with the number of its photons that reach a site.
    #[inline]
    pub fn photons<'a>(
        &'a self,
        site: usize,
        lines: &'a Lines,
    ) -> impl Iterator<Item = (&'a Line, f64)> {
        let photons = self.padded_photons(site, lines).iter();
        let lines = lines.all().iter();
        lines.zip(photons.map(|&photons| f64::from(photons)))
    }

    /// Number of photons of every line that reach a site, padded.
    #[inline]
    pub fn padded_photons(&self, site: usize, lines: &Lines) -> &[f32] {
        &self.photons[site * lines.padded()..][..lines.padded()]
    }

    /// Many histories are distributed equally over the sites, which are dense where scatter matters; the others follow the photons that
    /// continue, so that the weights are bounded.
    fn share_out(&mut self) {
        let whole: f64 = self.secondary.iter().sum();
        let mut sum = 0.0;
        self.cdf = self
            .secondary
            .iter()
            .map(|secondary| {
                sum += ALIKE / self.sites.len() as f64
                    + (1.0 - ALIKE) * secondary / whole.max(f64::MIN_POSITIVE);
                sum
            })
            .collect();
    }

    /// The history at `share` of all that continue: its site, energy, and the photons that it would represent if it
    /// were the only one.
    pub fn continuing(&self, share: f64, lines: &Lines) -> (&Site, f64, f64) {
        let target = share * self.cdf[self.cdf.len() - 1];
        let after = self.cdf.partition_point(|&sum| sum <= target);
        let index = after.min(self.sites.len() - 1);
        let site = &self.sites[index];
        let before = if index == 0 { 0.0 } else { self.cdf[index - 1] };
        let probability = self.cdf[index] - before;
        let inside = (target - before) / probability * self.secondary[index];
        let (mut energy_kev, mut sum) = (0.0, 0.0);
        for (line, photons) in self.photons(index, lines) {
            let here = photons * line.secondary[usize::from(site.material)];
            if here > 0.0 {
                energy_kev = line.energy_kev;
            }
            sum += here;
            if sum > inside {
                break;
            }
        }
        let weight = self.secondary[index] * self.cdf[self.cdf.len() - 1] / probability;
        (site, energy_kev, weight)
    }
}
