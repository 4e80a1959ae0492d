//! Photons scattered twice or more: histories whose collisions are seen from nodes of the detector.

use nalgebra::{Point3, Vector3};
use rayon::prelude::*;

use crate::engine::attenuation_basis::LANES;
use crate::engine::first_collisions::FirstCollisions;
use crate::engine::lines::Lines;
use crate::engine::node_grid::NodeGrid;
use crate::engine::outlook::{Outlook, Site, View};
use crate::engine::paths::{BasisMass, Paths, Step};
use crate::engine::turn::turned;
use crate::matter::scatter_density::ScatterDensities;
use crate::philox::Philox;
use crate::transport::attenuation::{CUTOFF_KEV, Coefficients};
use crate::transport::stream::Stream;
use crate::transport::tally::Moments;
use crate::transport::tracking::Transport;

/// Most histories from a list whose collisions are kept at the same time.
const ROUND: u64 = 8_192;

/// Histories for each collision that a node chooses to see.
const HISTORIES_PER_SIGHT: f64 = 16.0;

/// One choice in so many is also seen through the voxels themselves; the difference, so many times, makes up for what
/// the coarse cells get wrong on average.
const CHECKED: u32 = 8;

/// How weights are kept even. No expectation depends on it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Tactics {
    /// Histories that go on from a listed first collision, on average; more from strong ones, so that all of them have
    /// the same weight.
    pub splitting: u32,
    /// Share of that weight below which a photon either ends or is raised to that share.
    pub roulette: f64,
}

impl Default for Tactics {
    fn default() -> Self {
        Self {
            splitting: 2,
            roulette: 0.05,
        }
    }
}

/// What the histories share.
pub(crate) struct MultipleScatter<'a> {
    pub transport: &'a Transport<'a>,
    pub paths: &'a Paths<'a>,
    pub densities: &'a [ScatterDensities],
    pub lines: &'a Lines,
    pub lists: &'a [FirstCollisions],
    pub outlook: &'a Outlook<'a>,
    pub nodes: NodeGrid,
    pub tactics: Tactics,
}

/// Energy per cm² and history that multiple scatter leaves in the detector, at every node.
pub(crate) struct Seen {
    /// List by list.
    pub fluence: Vec<Vec<Moments>>,
    /// Largest share of a node's sum that a single sight added.
    pub largest_share: f64,
}

/// What a node has seen.
#[derive(Clone, Default)]
struct NodeSum {
    /// List by list.
    sums: Vec<Moments>,
    /// Largest single addition.
    largest: f64,
}

/// Buffers of one thread.
#[derive(Default)]
struct Scratch {
    view: View,
    mass: Vec<[f32; LANES]>,
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
    voxel: usize,
    distance_mm: f64,
}

/// Second and later collisions of the histories from a list. The strength of a site is the weight of its photon over the attenuation
/// of the material, so that times a scattering coefficient it is what scatters.
#[derive(Default)]
struct Collisions {
    sites: Vec<Site>,
    energies_kev: Vec<f32>,
}

impl MultipleScatter<'_> {
    /// Follows histories from all listed collisions.
    pub fn seen(&self, seed: u64) -> Seen {
        let listed = self.lists.iter().map(|list| list.sites.len()).max();
        let each = (listed.unwrap_or(0) as u64) * u64::from(self.tactics.splitting);
        let start = NodeSum {
            sums: vec![Moments::default(); self.lists.len()],
            largest: 0.0,
        };
        let mut nodes = vec![start; self.nodes.nodes()];
        for (round, first) in (0..each).step_by(ROUND as usize).enumerate() {
            let histories = first..(first + ROUND).min(each);
            let sights = (histories.end - histories.start) as f64 / HISTORIES_PER_SIGHT;
            let collisions: Vec<Collisions> = (0..self.lists.len())
                .into_par_iter()
                .map(|list| self.collisions(seed, list, histories.clone(), each))
                .collect();
            nodes.par_iter_mut().enumerate().for_each_init(
                Scratch::default,
                |scratch, (node, sum)| {
                    let index = (round * self.nodes.nodes() + node) as u64;
                    let stream = Stream::MultipleScatterSights as u32;
                    let mut rng = Philox::new(seed, stream, index);
                    self.see(node, &collisions, sights, sum, scratch, &mut rng);
                },
            );
        }
        let whole = |node: &NodeSum| node.sums.iter().map(|sum| sum.mean_kev).sum::<f64>();
        Seen {
            largest_share: nodes
                .iter()
                .map(|node| node.largest / whole(node).max(f64::MIN_POSITIVE))
                .fold(0.0, f64::max),
            fluence: (0..self.lists.len())
                .map(|list| nodes.iter().map(|node| node.sums[list]).collect())
                .collect(),
        }
    }

    /// Collisions of some of the `each` histories from a list.
    fn collisions(
        &self,
        seed: u64,
        number: usize,
        histories: std::ops::Range<u64>,
        each: u64,
    ) -> Collisions {
        let list = &self.lists[number];
        let mut collisions = Collisions::default();
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

    /// A photon that scatters here goes on. Later collisions happen or not; no photon is absorbed, but loses the weight
    /// that is, and light photons play roulette.
    fn history(
        &self,
        mut photon: Photon,
        material: u8,
        collisions: &mut Collisions,
        rng: &mut Philox,
    ) {
        let least = photon.weight * self.tactics.roulette;
        let mut here = self.at(material, photon.energy_kev);
        while self.scatter(&mut photon, here, rng) {
            let Some(Landing { voxel, distance_mm }) = self.fly(&photon, rng) else {
                return;
            };
            photon.position += photon.direction * distance_mm;
            let material = self.transport.phantom.material()[voxel];
            here = self.at(material, photon.energy_kev);
            let c = here.1;
            collisions.sites.push(Site {
                position: photon.position.cast(),
                direction: photon.direction.cast(),
                strength: (photon.weight / f64::from(c.total)) as f32,
                hardness: self.outlook.hardness(photon.energy_kev),
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
        let node = self.transport.attenuation.locate(energy_kev);
        let coefficients = self.transport.attenuation.at(material, node);
        (usize::from(material), coefficients)
    }

    /// Flies to the next collision, if there is one this side of the detector plane.
    fn fly(&self, photon: &Photon, rng: &mut Philox) -> Option<Landing> {
        let Transport {
            phantom,
            attenuation,
            projection,
            ..
        } = self.transport;
        let node = attenuation.locate(photon.energy_kev);
        let to_plane_mm = if photon.direction.z > 0.0 {
            (projection.source_detector_mm - photon.position.z) / photon.direction.z
        } else {
            f64::INFINITY
        };
        // 1 − u lies in (0, 1], so the logarithm stays finite.
        let mut depth = -(1.0 - rng.unit()).ln();
        let mut landing = None;
        self.paths.pieces(
            &photon.position,
            &photon.direction,
            to_plane_mm,
            |voxel, from_mm, to_mm| {
                let total = attenuation.at(phantom.material()[voxel], node).total;
                let mu = f64::from(phantom.density_g_cm3()[voxel] * total);
                let here = mu * (to_mm - from_mm);
                if depth >= here {
                    depth -= here;
                    return Step::Continue(());
                }
                let distance_mm = from_mm + depth / mu;
                landing = Some(Landing { voxel, distance_mm });
                Step::Break(())
            },
        );
        landing
    }

    /// Turns the photon; false if too little energy is left.
    fn scatter(
        &self,
        photon: &mut Photon,
        (material, c): (usize, Coefficients),
        rng: &mut Philox,
    ) -> bool {
        let tables = &self.transport.samplers[material];
        let compton = c.with_compton - c.photoelectric;
        let scattering = c.total - c.photoelectric;
        let cos_theta = if rng.unit() * f64::from(scattering) < f64::from(compton) {
            let (cos_theta, energy_kev) = tables.sample_compton(photon.energy_kev, rng);
            photon.energy_kev = energy_kev;
            cos_theta
        } else {
            tables.sample_rayleigh(photon.energy_kev, rng)
        };
        photon.direction = turned(&photon.direction, cos_theta, rng.unit());
        photon.energy_kev >= CUTOFF_KEV
    }

    /// Adds what a node sees of about `sights` collisions that it chooses for every list.
    fn see(
        &self,
        node: usize,
        collisions: &[Collisions],
        sights: f64,
        sum: &mut NodeSum,
        Scratch { view, mass }: &mut Scratch,
        rng: &mut Philox,
    ) {
        let at = self.nodes.place(node);
        let target = Point3::new(at.x, at.y, self.transport.projection.source_detector_mm);
        mass.resize(self.paths.basis.groups, [0.0; LANES]);
        view.look(self.outlook, &target);
        for (collisions, part) in collisions.iter().zip(&mut sum.sums) {
            let choices = (sights, rng.unit());
            let all = (0, 1);
            view.choose(
                self.outlook,
                &collisions.sites,
                all,
                choices,
                |index, inverse| {
                    let seen = self.sight(&target, collisions, index, mass, rng);
                    // mm² → cm²
                    let seen = seen.scaled(100.0 * inverse);
                    *part = [*part, seen].into_iter().sum();
                    sum.largest = sum.largest.max(seen.mean_kev.abs());
                },
            );
        }
    }

    /// What a photon about to collide sends to `target`, per mm².
    fn sight(
        &self,
        target: &Point3<f64>,
        collisions: &Collisions,
        index: usize,
        mass: &mut BasisMass,
        rng: &mut Philox,
    ) -> Moments {
        let site = &collisions.sites[index];
        let energy_kev = f64::from(collisions.energies_kev[index]);
        let material = usize::from(site.material);
        let position = site.position.cast::<f64>();
        let along = target - position;
        let r = along.norm();
        let direction = along / r;
        let cos_theta = direction.dot(&site.direction.cast()).clamp(-1.0, 1.0);
        let densities = &self.densities[material];
        let attenuation = &self.transport.attenuation;
        let c = attenuation.at(site.material, attenuation.locate(energy_kev));
        let scattered_kev =
            self.transport.samplers[material]
                .compton_energy_at(energy_kev, cos_theta, || rng.unit());
        let compton = f64::from(c.with_compton - c.photoelectric)
            * densities.compton_density(energy_kev, cos_theta);
        let rayleigh =
            f64::from(c.total - c.with_compton) * densities.rayleigh_density(energy_kev, cos_theta);
        let kinds =
            [(scattered_kev, compton), (energy_kev, rayleigh)].map(|(energy_kev, density)| {
                let followed = energy_kev >= CUTOFF_KEV;
                let response = &self.transport.response;
                let left = response.moments(energy_kev, [target.x, target.y], &direction);
                let left = left.scaled(if followed { density } else { 0.0 });
                (energy_kev, left)
            });
        let through = |mass: &BasisMass| -> Moments {
            kinds
                .iter()
                .map(|(energy_kev, left)| {
                    left.scaled(f64::from(-self.paths.basis.exponent(mass, *energy_kev)).exp())
                })
                .sum()
        };
        self.paths.coarse_between(&position, target, mass);
        let mut seen = through(mass);
        if !self.paths.coarse_is_exact() && rng.unit() * f64::from(CHECKED) < 1.0 {
            self.paths.between(&position, target, mass);
            let often = f64::from(CHECKED);
            let exact = through(mass).scaled(often);
            seen = [seen.scaled(1.0 - often), exact].into_iter().sum();
        }
        seen.scaled(f64::from(site.strength) * along.z / (r * r * r))
    }
}
