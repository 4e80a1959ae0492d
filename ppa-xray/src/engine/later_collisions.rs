//! Histories from the first collision on: splitting, survival weighting instead of absorption, and Russian roulette.
//!
//! Kahn and Harris, NBS Appl. Math. Ser. 12 (1951) 27; docs/physics.md, "Fast engine", multiple scatter.

use std::ops::Range;

use nalgebra::{Point3, Vector3};
use ppa_core::random::Philox;

use crate::engine::first_collisions::FirstCollisions;
use crate::engine::importance::ImportanceModel;
use crate::engine::lines::Lines;
use crate::engine::paths::{Paths, Step};
use crate::engine::rotation::rotated;
use crate::engine::site::Site;
use crate::matter::energy_range::CUTOFF_KEV;
use crate::transport::attenuation::Coefficients;
use crate::transport::stream::Stream;
use crate::transport::tracking::Transport;

/// How weights are kept even. No expectation depends on it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct VarianceReduction {
    /// Histories that continue from a listed first collision, on average; more from strong ones, so that all of them have
    /// the same weight.
    pub splitting: u32,
    /// Share of that weight below which a photon either ends or is raised to that share.
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

/// What the histories share.
pub(crate) struct Histories<'a> {
    pub transport: &'a Transport<'a>,
    pub paths: &'a Paths<'a>,
    pub lines: &'a Lines,
    pub lists: &'a [FirstCollisions],
    pub importance_model: &'a ImportanceModel<'a>,
    pub variance_reduction: VarianceReduction,
}

/// Second and later collisions of the histories from a list. The weight of a site is the weight of its photon over the attenuation
/// of the material, so that times a scattering coefficient it is what scatters.
#[derive(Default)]
pub(crate) struct LaterCollisions {
    pub sites: Vec<Site>,
    pub energies_kev: Vec<f32>,
}

/// A photon that has scattered.
struct Photon {
    position: Point3<f64>,
    direction: Vector3<f64>,
    energy_kev: f64,
    weight: f64,
}

/// Where a flight ends.
struct Landing {
    material: u8,
    distance_mm: f64,
}

impl Histories<'_> {
    /// Histories that continue from every list.
    pub fn each(&self) -> u64 {
        let listed = self.lists.iter().map(|list| list.sites.len()).max();
        (listed.unwrap_or(0) as u64) * u64::from(self.variance_reduction.splitting)
    }

    /// Collisions of some of the `each` histories from a list.
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
            let (site, energy_kev, photons) = list.scattering(share, self.lines);
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

    /// A photon that scatters here continues. Later collisions happen or not; no photon is absorbed, but loses the weight
    /// that is, and light photons play roulette.
    fn history(
        &self,
        mut photon: Photon,
        material: u8,
        collisions: &mut LaterCollisions,
        rng: &mut Philox,
    ) {
        let least = photon.weight * self.variance_reduction.roulette;
        let mut here = self.at(material, photon.energy_kev);
        while self.scatter(&mut photon, here, rng) {
            let Some(Landing {
                material,
                distance_mm,
            }) = self.fly(&photon, rng)
            else {
                return;
            };
            photon.position += photon.direction * distance_mm;
            here = self.at(material, photon.energy_kev);
            let c = here.1;
            collisions.sites.push(Site {
                position: photon.position.cast(),
                direction: photon.direction.cast(),
                weight: (photon.weight / f64::from(c.total)) as f32,
                attenuation_ratio: self.importance_model.attenuation_ratio(photon.energy_kev),
                material,
            });
            collisions.energies_kev.push(photon.energy_kev as f32);
            photon.weight *= f64::from((c.total - c.photoelectric) / c.total);
            if photon.weight < least {
                if rng.unit() * least >= photon.weight {
                    return;
                }
                photon.weight = least;
            }
        }
    }

    fn at(&self, material: u8, energy_kev: f64) -> (usize, Coefficients) {
        let node = self.transport.tables.attenuation.locate(energy_kev);
        let coefficients = self.transport.tables.attenuation.at(material, node);
        (usize::from(material), coefficients)
    }

    /// Flies to the next collision, if there is one this side of the detector plane.
    fn fly(&self, photon: &Photon, rng: &mut Philox) -> Option<Landing> {
        let Transport {
            tables, projection, ..
        } = self.transport;
        let attenuation = &tables.attenuation;
        let node = attenuation.locate(photon.energy_kev);
        let to_plane_mm = if photon.direction.z > 0.0 {
            (projection.source_detector_mm - photon.position.z) / photon.direction.z
        } else {
            f64::INFINITY
        };
        // 1 − u lies in (0, 1], so the logarithm stays finite.
        let mut depth = -(1.0 - rng.unit()).ln();
        let mut landing = None;
        self.paths.segments(
            &photon.position,
            &photon.direction,
            to_plane_mm,
            |code, from_mm, to_mm| {
                let material = code.material();
                let total = attenuation.at(material, node).total;
                let mu = f64::from(code.density_g_cm3() * total);
                let here = mu * (to_mm - from_mm);
                if depth >= here {
                    depth -= here;
                    return Step::Continue(());
                }
                let distance_mm = from_mm + depth / mu;
                landing = Some(Landing {
                    material,
                    distance_mm,
                });
                Step::Break(())
            },
        );
        landing
    }

    /// Rotates the direction of the photon; false if too little energy is left.
    fn scatter(
        &self,
        photon: &mut Photon,
        (material, c): (usize, Coefficients),
        rng: &mut Philox,
    ) -> bool {
        let tables = &self.transport.tables.samplers[material];
        let compton = c.with_compton - c.photoelectric;
        let scattering = c.total - c.photoelectric;
        let cos_theta = if rng.unit() * f64::from(scattering) < f64::from(compton) {
            let (cos_theta, energy_kev) = tables.sample_compton(photon.energy_kev, rng);
            photon.energy_kev = energy_kev;
            cos_theta
        } else {
            tables.sample_rayleigh(photon.energy_kev, rng)
        };
        photon.direction = rotated(&photon.direction, cos_theta, rng.unit());
        photon.energy_kev >= CUTOFF_KEV
    }
}
