//! Histories after the first collision, K x-rays included: splitting, survival weighting instead of absorption, and Russian
//! roulette.
//!
//! Kahn and Harris, NBS Appl. Math. Ser. 12 (1951) 27; docs/physics.md, "Fast engine", multiple scatter.

use std::ops::Range;

use nalgebra::{Point3, Vector3};
use ppa_core::random::Philox;

use crate::engine::delta_tracking::{Landing, fly};
use crate::engine::first_collisions::FirstCollisions;
use crate::engine::importance::ImportanceModel;
use crate::engine::lines::{Lines, secondary};
use crate::engine::paths::Paths;
use crate::engine::rotation::rotated;
use crate::engine::site::Site;
use crate::matter::energy_range::CUTOFF_KEV;
use crate::matter::sampler::MaterialTables;
use crate::transport::attenuation::Coefficients;
use crate::transport::stream::Stream;
use crate::transport::tracking::Transport;

/// Parameters that equalise the weights. No expectation depends on them.
#[derive(Debug, Clone, Copy)]
pub(crate) struct VarianceReduction {
    /// Average number of histories that continue from a listed first collision; strong ones get more, so that all histories have
    /// the same weight.
    pub splitting: u32,
    /// Share of that weight below which a photon is either ended or raised to that share.
    pub roulette: f64,
}

impl Default for VarianceReduction {
    fn default() -> Self {
        Self {
            splitting: 2,
            roulette: 0.05,
        }
    }
}

/// Data shared by the histories.
pub(crate) struct Histories<'a> {
    pub transport: &'a Transport<'a>,
    pub paths: &'a Paths<'a>,
    pub lines: &'a Lines,
    pub lists: &'a [FirstCollisions],
    pub importance_model: &'a ImportanceModel<'a>,
    pub variance_reduction: VarianceReduction,
}

/// Second and later collisions of the histories from a list. The weight of a site is the weight of its photon divided by the attenuation
/// of the material, so that multiplication by a scattering coefficient gives the scattered weight.
#[derive(Default)]
pub(crate) struct LaterCollisions {
    pub sites: Vec<Site>,
    pub events: Vec<Event>,
}

/// Outcome of a collision, with energies in keV.
#[derive(Clone, Copy)]
pub(crate) enum Event {
    /// The photon may scatter, or be absorbed and followed by a K x-ray.
    Any { energy_kev: f32 },
    /// The photon was absorbed and a K x-ray leaves; other photons that leave a first collision are single scatter.
    KRay { absorbed_kev: f32, line_kev: f32 },
}

/// A photon that has scattered.
struct Photon {
    position: Point3<f64>,
    direction: Vector3<f64>,
    energy_kev: f64,
    weight: f64,
}

impl Histories<'_> {
    /// Number of histories that continue from every list.
    pub fn each(&self) -> u64 {
        let listed = self.lists.iter().map(|list| list.sites.len()).max();
        (listed.unwrap_or(0) as u64) * u64::from(self.variance_reduction.splitting)
    }

    /// Follows some of the `each` histories from a list and returns their collisions.
    pub fn collisions(
        &self,
        seed: u64,
        number: usize,
        histories: Range<u64>,
        each: u64,
    ) -> LaterCollisions {
        let list = &self.lists[number];
        let mut collisions = LaterCollisions::default();
        if list.sites.is_empty() {
            return collisions;
        }
        let stream = Stream::MultipleScatterStarts as u32;
        let start = Philox::new(seed, stream, number as u64).unit();
        for history in histories {
            let index = (number as u64) << 40 | history;
            let mut rng = Philox::new(seed, Stream::MultipleScatter as u32, index);
            let share = (history as f64 + start) / each as f64;
            let (site, energy_kev, photons) = list.continuing(share, self.lines);
            let photon = Photon {
                position: site.position.cast(),
                direction: site.direction.cast(),
                energy_kev,
                weight: photons / each as f64,
            };
            self.history(photon, site.material, &mut collisions, &mut rng);
        }
        collisions
    }

    /// Follows a photon from its first collision here. Later collisions may or may not happen. No photon is absorbed; instead it loses the
    /// absorbed weight, and light photons play roulette.
    fn history(
        &self,
        mut photon: Photon,
        material: u8,
        collisions: &mut LaterCollisions,
        rng: &mut Philox,
    ) {
        let least = photon.weight * self.variance_reduction.roulette;
        let tables = &self.transport.tables;
        let energy = tables.attenuation.locate(photon.energy_kev);
        let mut c = tables.attenuation.at(material, energy);
        let mut sampler = &tables.samplers[usize::from(material)];
        let all = secondary(sampler, photon.energy_kev, &c);
        if let Some(line_kev) = sampler.k_fluorescence(photon.energy_kev, rng.unit()) {
            let event = Event::KRay {
                absorbed_kev: photon.energy_kev as f32,
                line_kev: line_kev as f32,
            };
            let weight = photon.weight / all;
            collisions
                .sites
                .push(self.site(&photon, material, weight, line_kev));
            collisions.events.push(event);
        }
        while continue_photon(&mut photon, sampler, &c, rng) {
            let Some(landing) = self.fly(&photon, rng) else {
                return;
            };
            photon.position += photon.direction * landing.distance_mm;
            c = landing.coefficients;
            sampler = &tables.samplers[usize::from(landing.material)];
            let total = f64::from(c.total);
            let weight = photon.weight / total;
            let energy_kev = photon.energy_kev;
            let site = self.site(&photon, landing.material, weight, energy_kev);
            collisions.sites.push(site);
            collisions.events.push(Event::Any {
                energy_kev: energy_kev as f32,
            });
            photon.weight *= secondary(sampler, photon.energy_kev, &c) / total;
            if photon.weight < least {
                if rng.unit() * least >= photon.weight {
                    return;
                }
                photon.weight = least;
            }
        }
    }

    /// Position of the photon for the importance model, which assumes outgoing photons of `outgoing_kev`.
    fn site(&self, photon: &Photon, material: u8, weight: f64, outgoing_kev: f64) -> Site {
        Site {
            position: photon.position.cast(),
            direction: photon.direction.cast(),
            weight: weight as f32,
            attenuation_ratio: self.importance_model.attenuation_ratio(outgoing_kev),
            material,
        }
    }

    /// Flies to the next collision, if there is one on this side of the detector plane.
    fn fly(&self, photon: &Photon, rng: &mut Philox) -> Option<Landing> {
        let Photon {
            position,
            direction,
            energy_kev,
            ..
        } = photon;
        let energy = self.transport.tables.attenuation.locate(*energy_kev);
        let to_plane_mm = if direction.z > 0.0 {
            (self.transport.projection.source_detector_mm - position.z) / direction.z
        } else {
            f64::INFINITY
        };
        fly(
            self.transport,
            position,
            direction,
            to_plane_mm,
            energy,
            rng,
        )
    }
}

/// Scatters the photon or replaces it by a K x-ray; returns false if too little energy is left.
fn continue_photon(
    photon: &mut Photon,
    tables: &MaterialTables,
    c: &Coefficients,
    rng: &mut Philox,
) -> bool {
    let scattering = f64::from(c.total - c.photoelectric);
    let compton = f64::from(c.with_compton - c.photoelectric);
    let xi = rng.unit() * secondary(tables, photon.energy_kev, c);
    let cos_theta = if xi < compton {
        let (cos_theta, energy_kev) = tables.sample_compton(photon.energy_kev, rng);
        photon.energy_kev = energy_kev;
        cos_theta
    } else if xi < scattering {
        tables.sample_rayleigh(photon.energy_kev, rng)
    } else {
        // The remaining part of the coefficient consists of absorptions that emit.
        let per_absorption = (xi - scattering) / f64::from(c.photoelectric);
        if let Some(line_kev) = tables.k_fluorescence(photon.energy_kev, per_absorption) {
            photon.energy_kev = line_kev;
            2.0 * rng.unit() - 1.0
        } else {
            // Rounding at the upper end, or no K x-rays.
            tables.sample_rayleigh(photon.energy_kev, rng)
        }
    };
    photon.direction = rotated(&photon.direction, cos_theta, rng.unit());
    photon.energy_kev >= CUTOFF_KEV
}
