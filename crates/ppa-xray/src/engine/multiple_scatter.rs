//! Photons scattered twice or more: histories whose collisions are seen from nodes of the detector.

use nalgebra::{Point3, Vector3};
use rayon::prelude::*;

use crate::engine::attenuation_basis::LANES;
use crate::engine::collision_map::CollisionMap;
use crate::engine::node_grid::NodeGrid;
use crate::engine::paths::{Paths, Step};
use crate::engine::quasi_random::QuasiRandom;
use crate::engine::turn::turned;
use crate::matter::scatter_density::ScatterDensities;
use crate::philox::Philox;
use crate::transport::attenuation::{CUTOFF_KEV, Coefficients};
use crate::transport::stream::Stream;
use crate::transport::tally::Moments;
use crate::transport::tracking::Transport;

/// Independent parts of the histories, from whose spread the error is told.
pub(crate) const PARTS: usize = 32;

/// Nodes that a collision is seen from.
const SIGHTS: u32 = 8;

/// One collision in so many is also seen through the voxels themselves; the difference, so many times, makes up for
/// what the coarse cells get wrong on average.
const CHECKED: u32 = 8;

/// What the histories share.
pub(crate) struct MultipleScatter<'a> {
    pub transport: &'a Transport<'a>,
    pub paths: &'a Paths<'a>,
    pub densities: &'a [ScatterDensities],
    pub map: &'a CollisionMap,
    pub nodes: NodeGrid,
}

/// Energy per cm² and history that multiple scatter leaves in the detector, at every node.
pub(crate) struct Seen {
    /// Part by part.
    pub fluence: Vec<Vec<Moments>>,
    /// Largest share of a node's sum that a single sight added.
    pub largest_share: f64,
}

/// Sums of one part, and its buffers.
struct Part {
    fluence: Vec<Moments>,
    /// Largest single addition, by node.
    largest: Vec<f64>,
    places: Vec<Point3<f64>>,
    expected: Vec<f64>,
    mass: Vec<[f32; LANES]>,
}

/// A photon that has scattered.
struct Photon {
    position: Point3<f64>,
    direction: Vector3<f64>,
    energy_kev: f64,
}

/// Where a flight ends.
struct Landing {
    voxel: usize,
    distance_mm: f64,
}

impl MultipleScatter<'_> {
    /// Follows `histories` histories that all collide in the box.
    pub fn seen(&self, seed: u64, histories: u64) -> Seen {
        let each = histories.div_ceil(PARTS as u64);
        let parts: Vec<Part> = (0..PARTS as u64)
            .into_par_iter()
            .map(|part| self.part(seed, part, each))
            .collect();
        let largest_share = (0..self.nodes.nodes())
            .map(|node| {
                let sum: f64 = parts.iter().map(|part| part.fluence[node].mean_kev).sum();
                let largest = parts.iter().map(|part| part.largest[node]);
                largest.fold(0.0, f64::max) / sum.max(f64::MIN_POSITIVE)
            })
            .fold(0.0, f64::max);
        Seen {
            largest_share,
            fluence: parts
                .into_iter()
                .map(|part| {
                    let sums = part.fluence.iter();
                    sums.map(|sum| sum.scaled(1.0 / each as f64)).collect()
                })
                .collect(),
        }
    }

    fn part(&self, seed: u64, number: u64, histories: u64) -> Part {
        let plane_mm = self.transport.projection.source_detector_mm;
        let nodes = self.nodes.nodes();
        let mut part = Part {
            fluence: vec![Moments::default(); nodes],
            largest: vec![0.0; nodes],
            places: (0..nodes)
                .map(|node| self.nodes.place(node))
                .map(|at| Point3::new(at.x, at.y, plane_mm))
                .collect(),
            expected: Vec::new(),
            mass: vec![[0.0; LANES]; self.paths.basis.groups],
        };
        // A stream of its own for the even points of the part; the histories have theirs.
        let mut rng = Philox::new(seed, Stream::MultipleScatterStarts as u32, number);
        let mut points = QuasiRandom::<4>::new(&mut rng);
        for history in 0..histories {
            let index = number << 40 | history;
            let mut rng = Philox::new(seed, Stream::MultipleScatter as u32, index);
            self.history(points.next(), &mut part, &mut rng);
        }
        part
    }

    /// The first collision is forced to be a scattering in the box; later ones happen or not, and each adds what it can
    /// be expected to send to the nodes. Absorption ends the history by lot.
    fn history(&self, [u, v, w, energy]: [f64; 4], part: &mut Part, rng: &mut Philox) {
        let Transport {
            phantom, emitter, ..
        } = self.transport;
        let collision = self
            .map
            .draw([u, v, w], None, self.transport, self.paths, rng);
        let Some(voxel) = self.paths.voxel_at(&collision.position) else {
            return; // on the surface of the box, but for rounding
        };
        let mixture = emitter.mixture(&collision.direction);
        let upper = usize::from(mixture.upper_share > 0.0 && rng.unit() < mixture.upper_share);
        let (energy_kev, photons) = self.map.energies[mixture.lower + upper].draw(energy);
        let (material, c) = self.at(voxel, energy_kev);
        let scattering = c.total - c.photoelectric;
        self.paths
            .between(&collision.spot, &collision.position, &mut part.mass);
        let exponent = f64::from(self.paths.basis.exponent(&part.mass, energy_kev));
        let weight = photons * emitter.open_fluence_cm2(&collision.spot, collision.aim) / 100.0
            * collision.mm3
            * f64::from(phantom.density_g_cm3()[voxel] * scattering)
            * (-exponent).exp();
        let mut photon = Photon {
            position: collision.position,
            direction: collision.direction,
            energy_kev,
        };
        let compton =
            rng.unit() * f64::from(scattering) < f64::from(c.with_compton - c.photoelectric);
        let mut goes_on = self.scatter(&mut photon, material, compton, rng);
        while goes_on {
            let Some(Landing { voxel, distance_mm }) = self.fly(&photon, rng) else {
                return;
            };
            photon.position += photon.direction * distance_mm;
            let (material, c) = self.at(voxel, photon.energy_kev);
            self.show(&photon, material, &c, weight, part, rng);
            let lot = rng.unit() * f64::from(c.total);
            goes_on = lot >= f64::from(c.photoelectric)
                && self.scatter(&mut photon, material, lot < f64::from(c.with_compton), rng);
        }
    }

    fn at(&self, voxel: usize, energy_kev: f64) -> (usize, Coefficients) {
        let material = self.transport.phantom.material()[voxel];
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
        material: usize,
        compton: bool,
        rng: &mut Philox,
    ) -> bool {
        let tables = &self.transport.samplers[material];
        let cos_theta = if compton {
            let (cos_theta, energy_kev) = tables.sample_compton(photon.energy_kev, rng);
            photon.energy_kev = energy_kev;
            cos_theta
        } else {
            tables.sample_rayleigh(photon.energy_kev, rng)
        };
        photon.direction = turned(&photon.direction, cos_theta, rng.unit());
        photon.energy_kev >= CUTOFF_KEV
    }

    /// Adds what a photon that collides here can be expected to send to the nodes: [`SIGHTS`] of them stand for all,
    /// chosen by even steps through the running sum of what they would get if nothing were in the way.
    fn show(
        &self,
        photon: &Photon,
        material: usize,
        c: &Coefficients,
        weight: f64,
        part: &mut Part,
        rng: &mut Philox,
    ) {
        let energy_kev = photon.energy_kev;
        let densities = &self.densities[material];
        let tables = &self.transport.samplers[material];
        let response = &self.transport.response;
        let compton = f64::from((c.with_compton - c.photoelectric) / c.total);
        let rayleigh = f64::from((c.total - c.with_compton) / c.total);
        let by_kind = |cos_theta: f64| {
            [
                compton * densities.compton_density(energy_kev, cos_theta),
                rayleigh * densities.rayleigh_density(energy_kev, cos_theta),
            ]
        };
        let Part {
            fluence,
            largest,
            places,
            expected,
            mass,
        } = part;
        let mut sum = 0.0;
        expected.clear();
        expected.extend(places.iter().map(|place| {
            let sight = Sight::new(photon, place);
            sum += self.map.typical_density(sight.cos_theta) * sight.per_mm2;
            sum
        }));
        let step = sum / f64::from(SIGHTS);
        let mut next = rng.unit() * step;
        let checked = !self.paths.coarse_is_exact() && rng.unit() * f64::from(CHECKED) < 1.0;
        let mut low = 0.0;
        for (node, &high) in expected.iter().enumerate() {
            let size = high - low;
            low = high;
            let mut times = 0.0;
            while next < high {
                times += 1.0;
                next += step;
            }
            if times == 0.0 {
                continue;
            }
            let place = &places[node];
            let sight = Sight::new(photon, place);
            let weight = 100.0 * weight * times * step / size * sight.per_mm2;
            let scattered_kev =
                tables.compton_energy_at(energy_kev, sight.cos_theta, || rng.unit());
            let [compton, rayleigh] = by_kind(sight.cos_theta);
            let kinds =
                [(scattered_kev, compton), (energy_kev, rayleigh)].map(|(energy_kev, density)| {
                    let followed = energy_kev >= CUTOFF_KEV;
                    let left = response.moments(energy_kev, [place.x, place.y], &sight.direction);
                    (
                        energy_kev,
                        left.scaled(if followed { density } else { 0.0 }),
                    )
                });
            let through = |mass: &[[f32; LANES]]| -> Moments {
                kinds
                    .iter()
                    .map(|(energy_kev, left)| {
                        left.scaled(f64::from(-self.paths.basis.exponent(mass, *energy_kev)).exp())
                    })
                    .sum()
            };
            self.paths.coarse_between(&photon.position, place, mass);
            let rough = through(mass);
            let mut whole = rough;
            if checked {
                self.paths.between(&photon.position, place, mass);
                let often = f64::from(CHECKED);
                whole = [rough.scaled(1.0 - often), through(mass).scaled(often)]
                    .into_iter()
                    .sum();
            }
            let whole = whole.scaled(weight);
            fluence[node] = [fluence[node], whole].into_iter().sum();
            largest[node] = largest[node].max(whole.mean_kev.abs());
        }
    }
}

/// A node as a photon sees it.
struct Sight {
    direction: Vector3<f64>,
    cos_theta: f64,
    /// cos α / r², 1/mm².
    per_mm2: f64,
}

impl Sight {
    #[inline]
    fn new(photon: &Photon, place: &Point3<f64>) -> Self {
        let along: Vector3<f64> = place - photon.position;
        let square = along.norm_squared();
        let r = square.sqrt();
        Self {
            direction: along / r,
            cos_theta: (along.dot(&photon.direction) / r).clamp(-1.0, 1.0),
            per_mm2: along.z / (r * square),
        }
    }
}
