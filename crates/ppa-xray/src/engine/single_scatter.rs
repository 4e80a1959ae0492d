//! Photons scattered once, as an integral over first collisions for a point of the detector.

use nalgebra::{Point2, Point3};
use rayon::prelude::*;

use crate::engine::attenuation_basis::{LANES, dot};
use crate::engine::collision_map::{Collision, CollisionMap};
use crate::engine::paths::{BasisMass, Paths};
use crate::engine::quasi_random::QuasiRandom;
use crate::engine::scatter_table::ScatterTable;
use crate::engine::spectral_quadrature::SpectralQuadrature;
use crate::matter::scatter_density::ScatterDensities;
use crate::philox::Philox;
use crate::transport::attenuation::CUTOFF_KEV;
use crate::transport::stream::Stream;
use crate::transport::tally::Moments;
use crate::transport::tracking::Transport;

/// Independent estimates per point, from whose spread the error is told.
pub(crate) const ESTIMATES: usize = 8;

/// One collision in so many is also seen through the voxels themselves; the difference, so many times, makes up for
/// what the coarse cells get wrong on average.
const CHECKED: u32 = 8;

/// Collisions that are looked at for each one that is followed to the detector.
const CANDIDATES: u32 = 4;

/// What a point of the detector sees.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct SingleScatter {
    /// Energy per cm² and history that Compton and Rayleigh scatter leave in the detector.
    pub estimates: [[Moments; 2]; ESTIMATES],
    /// Largest share of both that a single collision added.
    pub largest_share: f64,
}

/// First collisions as points of the detector see them.
pub(crate) struct FirstCollisions<'a> {
    transport: &'a Transport<'a>,
    paths: &'a Paths<'a>,
    map: &'a CollisionMap,
    /// For each spectrum of the emitter.
    spectra: Vec<Vec<Line>>,
}

/// An energy of a quadrature.
struct Line {
    energy_kev: f64,
    photons: f64,
    /// Attenuation of the basis materials.
    attenuation: Vec<[f32; LANES]>,
    /// By material.
    scattering: Vec<ScatterTable>,
}

/// Buffers of one thread.
#[derive(Default)]
pub(crate) struct Scratch {
    sums: Vec<f64>,
    passing: Vec<f64>,
    before: Vec<[f32; LANES]>,
    after: Vec<[f32; LANES]>,
}

/// A collision as one point sees it.
struct Sight {
    at_mm: [f64; 2],
    direction: nalgebra::Vector3<f64>,
    cos_theta: f64,
    material: usize,
    /// Spectra of the photon, with their shares.
    spectra: [(usize, f64); 2],
}

impl<'a> FirstCollisions<'a> {
    pub fn new(
        transport: &'a Transport<'a>,
        paths: &'a Paths<'a>,
        densities: &'a [ScatterDensities],
        map: &'a CollisionMap,
        quadratures: &[SpectralQuadrature],
    ) -> Self {
        let line = |energy_kev: f64, photons: f64| {
            let node = transport.attenuation.locate(energy_kev);
            let of = |material: usize| {
                let c = transport.attenuation.at(material as u8, node);
                let tables = &transport.samplers[material];
                ScatterTable::new(&densities[material], tables, energy_kev, &c)
            };
            Line {
                energy_kev,
                photons,
                attenuation: paths.basis.at(energy_kev),
                scattering: (0..densities.len()).into_par_iter().map(of).collect(),
            }
        };
        Self {
            transport,
            paths,
            map,
            spectra: quadratures
                .iter()
                .map(|q| {
                    let lines = q.energy_kev.iter().zip(&q.photons);
                    lines.map(|(&e, &photons)| line(e, photons)).collect()
                })
                .collect(),
        }
    }

    /// What a point of the detector sees, estimated [`ESTIMATES`] times from `collisions` collisions each.
    ///
    /// Point `index` of a seed has the same random numbers whatever is computed beside it.
    pub fn at(
        &self,
        at: Point2<f64>,
        (seed, index): (u64, u64),
        collisions: u32,
        scratch: &mut Scratch,
    ) -> SingleScatter {
        let target = Point3::new(at.x, at.y, self.transport.projection.source_detector_mm);
        for mass in [&mut scratch.before, &mut scratch.after] {
            mass.resize(self.paths.basis.groups, [0.0; LANES]);
        }
        let Scratch {
            sums,
            passing,
            after,
            ..
        } = scratch;
        self.map.aim(&target, self.paths, after, sums, passing);
        let rough = !self.paths.coarse_is_exact();
        let mut result = SingleScatter::default();
        let (mut largest, mut whole) = (0.0_f64, 0.0);
        for (estimate, sum) in result.estimates.iter_mut().enumerate() {
            let number = index * ESTIMATES as u64 + estimate as u64;
            let mut rng = Philox::new(seed, Stream::SingleScatter as u32, number);
            let mut points = QuasiRandom::<3>::new(&mut rng);
            let first = (rng.unit() * f64::from(CHECKED)) as u32;
            for number in 0..collisions {
                let Some(collision) = self.choose(&target, &mut points, scratch, &mut rng) else {
                    continue;
                };
                let exact = rough && number % CHECKED == first;
                let before = sum[0].mean_kev + sum[1].mean_kev;
                self.add(&target, &collision, exact, scratch, sum);
                largest = largest.max((sum[0].mean_kev + sum[1].mean_kev - before).abs());
            }
            whole += sum[0].mean_kev + sum[1].mean_kev;
            *sum = sum.map(|moments| moments.scaled(100.0 / f64::from(collisions)));
        }
        result.largest_share = largest / whole.max(f64::MIN_POSITIVE);
        result
    }

    /// One of [`CANDIDATES`] collisions, by how much it can be expected to send to `target`; none if none of them would.
    ///
    /// Resampled importance sampling: the mean of the candidates' weights over the weight of the chosen one takes the
    /// place of the inverse probability, and leaves the expectation as it is (Talbot, Cline and Egbert, EGSR 2005).
    fn choose(
        &self,
        target: &Point3<f64>,
        points: &mut QuasiRandom<3>,
        scratch: &Scratch,
        rng: &mut Philox,
    ) -> Option<Collision> {
        let mut chosen = None;
        let mut sum = 0.0;
        for _ in 0..CANDIDATES {
            let collision = self.map.draw(
                points.next(),
                Some(&scratch.sums),
                self.transport,
                self.paths,
                rng,
            );
            let Some(voxel) = self.paths.voxel_at(&collision.position) else {
                continue; // on the surface of the box, but for rounding
            };
            let along = target - collision.position;
            let square = along.norm_squared();
            let r = square.sqrt();
            let cos_theta = along.dot(&collision.direction) / r;
            let expected = f64::from(self.transport.phantom.density_g_cm3()[voxel])
                * self.map.typical_density(cos_theta)
                * scratch.passing[collision.cell]
                * along.z
                / (r * square);
            let weight = expected * collision.mm3;
            sum += weight;
            if weight > 0.0 && rng.unit() * sum < weight {
                chosen = Some((collision, expected));
            }
        }
        chosen.map(|(collision, expected)| Collision {
            mm3: sum / f64::from(CANDIDATES) / expected,
            ..collision
        })
    }

    /// Adds what photons of one collision bring to `target`.
    fn add(
        &self,
        target: &Point3<f64>,
        collision: &Collision,
        exact: bool,
        scratch: &mut Scratch,
        sum: &mut [Moments; 2],
    ) {
        let Some(voxel) = self.paths.voxel_at(&collision.position) else {
            return; // on the surface of the box, but for rounding
        };
        let Transport {
            phantom, emitter, ..
        } = self.transport;
        let Scratch { before, after, .. } = scratch;
        let (spot, position) = (&collision.spot, &collision.position);
        let along = target - position;
        let r = along.norm();
        let emitted = emitter.open_fluence_cm2(spot, collision.aim) / 100.0;
        let density = f64::from(phantom.density_g_cm3()[voxel]);
        let weight = emitted * collision.mm3 * density * along.z / (r * r * r);
        let mut parts = emitter.mixture(&collision.direction).parts();
        let first = parts.next().unwrap_or((0, 1.0));
        let sight = Sight {
            at_mm: [target.x, target.y],
            direction: along / r,
            cos_theta: (along.dot(&collision.direction) / r).clamp(-1.0, 1.0),
            material: usize::from(phantom.material()[voxel]),
            spectra: [first, parts.next().unwrap_or((first.0, 0.0))],
        };
        self.paths.coarse_between(spot, position, before);
        self.paths.coarse_between(position, target, after);
        let rough = self.energies(&sight, before, after);
        let mut add = |parts: [Moments; 2], weight: f64| {
            for (sum, part) in sum.iter_mut().zip(parts) {
                *sum = [*sum, part.scaled(weight)].into_iter().sum();
            }
        };
        add(rough, weight);
        if exact {
            self.paths.between(spot, position, before);
            self.paths.between(position, target, after);
            let exact = self.energies(&sight, before, after);
            let weight = weight * f64::from(CHECKED);
            add(exact, weight);
            add(rough, -weight);
        }
    }

    /// Energy that photons scattered from a gram of the collision leave in the detector, per solid angle.
    #[inline]
    fn energies(&self, sight: &Sight, before: &BasisMass, after: &BasisMass) -> [Moments; 2] {
        let mut sum = [Moments::default(); 2];
        let response = &self.transport.response;
        let mut add = |kind: usize, energy_kev: f64, photons: f64| {
            let left = response.moments(energy_kev, sight.at_mm, &sight.direction);
            sum[kind].mean_kev += photons * left.mean_kev;
            sum[kind].square_kev2 += photons * left.square_kev2;
        };
        let angle = ScatterTable::locate(sight.cos_theta);
        for (spectrum, share) in sight.spectra {
            if share == 0.0 {
                continue;
            }
            for line in &self.spectra[spectrum] {
                let scattering = line.scattering[sight.material].at(angle);
                let inwards = dot(before, &line.attenuation);
                let photons = share * line.photons;
                let through = f64::from(-inwards - dot(after, &line.attenuation)).exp();
                add(1, line.energy_kev, photons * scattering.rayleigh * through);
                if scattering.compton_kev >= CUTOFF_KEV {
                    let outwards = self.paths.basis.exponent(after, scattering.compton_kev);
                    let through = f64::from(-inwards - outwards).exp();
                    add(
                        0,
                        scattering.compton_kev,
                        photons * scattering.compton * through,
                    );
                }
            }
        }
        sum
    }
}
