//! Photons scattered once: next-event estimation (forced detection) at points of the detector.
//!
//! Estimator: a point samples collisions of the lists by its importance model, with systematic sampling, and scores
//! w · dσ/dΩ · exp(−∫µ ds) · cos θ / r² · response for each. Coarse cells give the optical depth; a quarter of the samples add the exact value minus
//! the coarse one, times four (two-level estimator: Giles, Oper. Res. 56 (2008) 607), so the expectation is that of the voxels.
//! Kalos, Nucl. Sci. Eng. 16 (1963) 111; docs/physics.md, "Fast engine", single scatter.

use nalgebra::{Point2, Point3, Vector3};
use ppa_core::random::Philox;

use crate::detector::response::Response;
use crate::engine::attenuation_basis::BasisMass;
use crate::engine::attenuation_basis::{LANES, dot};
use crate::engine::first_collisions::{ESTIMATES, FirstCollisions};
use crate::engine::importance::{Draws, ImportanceModel, PointImportance, Subset};
use crate::engine::lines::Lines;
use crate::engine::paths::Paths;
use crate::engine::scatter_table::ScatterTable;
use crate::matter::energy_range::CUTOFF_KEV;
use crate::transport::stream::Stream;
use crate::transport::tally::Moments;
use crate::transport::tracking::Transport;

/// One sample in so many is repeated through the voxels themselves; the difference, times that number, corrects the bias of
/// the coarse cells.
const CHECKED: u32 = 4;

/// Estimates at a point of the detector.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Seen {
    /// Energy per cm² and history that Compton and Rayleigh scatter leave in the detector.
    pub estimates: [[Moments; 2]; ESTIMATES],
    /// Largest share of both that a single collision added.
    pub largest_share: f64,
}

/// Next-event estimation from first collisions.
pub(crate) struct SingleScatter<'a> {
    pub transport: &'a Transport<'a>,
    pub response: &'a Response,
    pub paths: &'a Paths<'a>,
    pub importance_model: &'a ImportanceModel<'a>,
    pub lines: &'a Lines,
    pub lists: &'a [FirstCollisions],
}

/// How a point samples the collisions of each list.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PointSampling {
    /// Mean number of collisions sampled.
    pub collisions: f64,
    /// Only every so many-th of the list takes part.
    pub every: usize,
}

/// Buffers of one thread.
#[derive(Default)]
pub(crate) struct Scratch {
    importance: PointImportance,
    mass: Vec<[f32; LANES]>,
}

/// A collision and the direction from it to the point.
struct Sight<'a> {
    list: &'a FirstCollisions,
    site: usize,
    at_mm: [f64; 2],
    direction: Vector3<f64>,
    cos_theta: f64,
}

impl SingleScatter<'_> {
    /// Scatter at a point of the detector.
    ///
    /// Point `index` of a seed has the same random numbers whatever is computed beside it.
    pub fn at(
        &self,
        at: Point2<f64>,
        (seed, index): (u64, u64),
        PointSampling { collisions, every }: PointSampling,
        Scratch { importance, mass }: &mut Scratch,
    ) -> Seen {
        let target = Point3::new(at.x, at.y, self.transport.projection.source_detector_mm);
        mass.resize(self.paths.basis.groups, [0.0; LANES]);
        importance.tabulate(self.importance_model, &target);
        let rough = !self.paths.coarse_is_exact();
        let mut result = Seen::default();
        let (mut largest, mut whole) = (0.0_f64, 0.0);
        let mut rng = Philox::new(seed, Stream::SingleScatterSights as u32, index);
        for (list, sum) in self.lists.iter().zip(&mut result.estimates) {
            let first = (rng.unit() * every as f64) as usize;
            let mut until_check = (rng.unit() * f64::from(CHECKED)) as u32;
            let draws = Draws {
                count: collisions,
                u: rng.unit(),
            };
            importance.sample(
                self.importance_model,
                &list.sites,
                Subset { first, every },
                draws,
                |site, inverse| {
                    let exact = rough && until_check == 0;
                    until_check = until_check.checked_sub(1).unwrap_or(CHECKED - 1);
                    // mm² → cm²
                    let weight = 100.0 * inverse * every as f64;
                    let seen = self.seen(&target, list, site, exact, mass);
                    let seen = seen.map(|part| part.scaled(weight));
                    largest = largest.max((seen[0].mean_kev + seen[1].mean_kev).abs());
                    for (sum, part) in sum.iter_mut().zip(seen) {
                        *sum = [*sum, part].into_iter().sum();
                    }
                },
            );
            whole += sum[0].mean_kev + sum[1].mean_kev;
        }
        result.largest_share = largest / whole.max(f64::MIN_POSITIVE);
        result
    }

    /// Compton and Rayleigh part of what one collision brings to `target`, per mm².
    fn seen(
        &self,
        target: &Point3<f64>,
        list: &FirstCollisions,
        index: usize,
        exact: bool,
        mass: &mut BasisMass,
    ) -> [Moments; 2] {
        let site = &list.sites[index];
        let position = site.position.cast::<f64>();
        let along = target - position;
        let r = along.norm();
        let direction = along / r;
        let sight = Sight {
            list,
            site: index,
            at_mm: [target.x, target.y],
            direction,
            cos_theta: direction.dot(&site.direction.cast()).clamp(-1.0, 1.0),
        };
        self.paths.coarse_between(&position, target, mass);
        let mut seen = self.energies(&sight, mass);
        if exact {
            self.paths.between(&position, target, mass);
            let inverse_share = f64::from(CHECKED);
            for (rough, exact) in seen.iter_mut().zip(self.energies(&sight, mass)) {
                *rough = [
                    rough.scaled(1.0 - inverse_share),
                    exact.scaled(inverse_share),
                ]
                .into_iter()
                .sum();
            }
        }
        seen.map(|part| part.scaled(along.z / (r * r * r)))
    }

    /// Energy that the photons of a collision leave in the detector, per solid angle.
    #[inline]
    fn energies(&self, sight: &Sight, after: &BasisMass) -> [Moments; 2] {
        let mut sum = [Moments::default(); 2];
        let response = self.response;
        let mut add = |kind: usize, energy_kev: f64, photons: f64| {
            let left = response.moments(energy_kev, sight.at_mm, &sight.direction);
            sum[kind].mean_kev += photons * left.mean_kev;
            sum[kind].square_kev2 += photons * left.square_kev2;
        };
        let angle = ScatterTable::locate(sight.cos_theta);
        let material = usize::from(sight.list.sites[sight.site].material);
        for (line, photons) in sight.list.photons(sight.site, self.lines) {
            let scattering = line.scattering[material].at(angle);
            let through = f64::from(-dot(after, &line.attenuation)).exp();
            add(1, line.energy_kev, photons * scattering.rayleigh * through);
            if scattering.compton_kev >= CUTOFF_KEV {
                let outwards = self.paths.basis.exponent(after, scattering.compton_kev);
                let photons = photons * scattering.compton * f64::from(-outwards).exp();
                add(0, scattering.compton_kev, photons);
            }
        }
        sum
    }
}
