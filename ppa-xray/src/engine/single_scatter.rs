//! Photons scattered once: next-event estimation (forced detection) at points of the detector.
//!
//! Estimator: a point samples collisions of the lists by its importance model, with systematic sampling, and scores
//! w · dσ/dΩ · exp(−∫µ ds) · cos θ / r² · response for each. Coarse cells give the optical depth; a quarter of the samples add the exact
//! value minus the coarse one, times four (two-level estimator: Giles, Oper. Res. 56 (2008) 607), so the expectation is that of the voxels.
//! Kalos, Nucl. Sci. Eng. 16 (1963) 111; docs/physics.md, "Fast engine", single scatter.

use nalgebra::{Point2, Point3};
use ppa_core::random::Philox;

use crate::detector::tabulated_response::{Incidence, TabulatedResponse};
use crate::engine::attenuation_basis::{BasisMass, LANES, exponents};
use crate::engine::expected_scores::Subset;
use crate::engine::first_collisions::{ESTIMATES, FirstCollisions};
use crate::engine::importance::{Draws, ImportanceModel, PointImportance};
use crate::engine::line_scattering::LinesAtAngle;
use crate::engine::lines::Lines;
use crate::engine::paths::Paths;
use crate::engine::scatter_table::ScatterTable;
use crate::transport::stream::Stream;
use crate::transport::tally::Moments;
use crate::transport::tracking::Transport;
use crate::vector_math::{WIDTH, exp};

/// One sample in this many is repeated through the voxels themselves; the difference, times this number, corrects the bias of
/// the coarse cells.
const CORRECTION_INTERVAL: u32 = 4;

/// Estimates at a point of the detector.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct NodeEstimate {
    /// Energy per cm² and history that Compton and Rayleigh scatter deposit in the detector.
    pub estimates: [[Moments; 2]; ESTIMATES],
    /// Largest share of a single collision in both.
    pub largest_share: f64,
}

/// Next-event estimation from first collisions.
pub(crate) struct SingleScatter<'a> {
    pub transport: &'a Transport<'a>,
    pub response: &'a TabulatedResponse<'a>,
    pub paths: &'a Paths<'a>,
    pub importance_model: &'a ImportanceModel<'a>,
    pub lines: &'a Lines,
    pub lists: &'a [FirstCollisions],
}

/// Sampling of the collisions of each list at a point.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PointSampling {
    /// Mean number of collisions sampled.
    pub collisions: f64,
    /// Interval of the sites of the list that are used.
    pub every: usize,
}

/// Buffers of one thread.
#[derive(Default)]
pub(crate) struct Scratch {
    importance: PointImportance,
    buffers: Buffers,
}

/// Buffers of a contribution.
#[derive(Default)]
struct Buffers {
    mass: Vec<[f32; LANES]>,
    scattering: LinesAtAngle,
    photons: Vec<f32>,
}

/// A collision and the direction from it to the point.
struct PathToPoint<'a> {
    /// Photons that reach the collision, line by line.
    photons: &'a [f32],
    incidence: Incidence<'a>,
}

impl SingleScatter<'_> {
    /// Scatter at a point of the detector.
    ///
    /// Point `index` of a seed has the same random numbers regardless of the other points.
    pub fn at(
        &self,
        at: Point2<f64>,
        (seed, index): (u64, u64),
        PointSampling { collisions, every }: PointSampling,
        Scratch {
            importance,
            buffers,
        }: &mut Scratch,
    ) -> NodeEstimate {
        let target = Point3::new(at.x, at.y, self.transport.projection.source_detector_mm);
        buffers.mass.resize(self.paths.basis.groups, [0.0; LANES]);
        importance.tabulate(self.importance_model, &target);
        let rough = !self.paths.coarse_is_exact();
        let mut result = NodeEstimate::default();
        let (mut largest, mut whole) = (0.0_f64, 0.0);
        let mut rng = Philox::new(seed, Stream::SingleScatterSampling as u32, index);
        for (list, sum) in self.lists.iter().zip(&mut result.estimates) {
            let first = (rng.unit() * every as f64) as usize;
            let mut until_correction = (rng.unit() * f64::from(CORRECTION_INTERVAL)) as u32;
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
                    let exact = rough && until_correction == 0;
                    until_correction = until_correction
                        .checked_sub(1)
                        .unwrap_or(CORRECTION_INTERVAL - 1);
                    // mm² → cm²
                    let weight = 100.0 * inverse * every as f64;
                    let part = self.contribution(&target, list, site, exact, buffers);
                    let part = part.map(|part| part.scaled(weight));
                    largest = largest.max((part[0].mean_kev + part[1].mean_kev).abs());
                    for (sum, part) in sum.iter_mut().zip(part) {
                        *sum = [*sum, part].into_iter().sum();
                    }
                },
            );
            whole += sum[0].mean_kev + sum[1].mean_kev;
        }
        result.largest_share = largest / whole.max(f64::MIN_POSITIVE);
        result
    }

    /// Compton and Rayleigh part of the contribution of one collision to `target`, per mm².
    fn contribution(
        &self,
        target: &Point3<f64>,
        list: &FirstCollisions,
        index: usize,
        exact: bool,
        Buffers {
            mass,
            scattering,
            photons,
        }: &mut Buffers,
    ) -> [Moments; 2] {
        let site = &list.sites[index];
        let position = site.position.cast::<f64>();
        let along = target - position;
        let r = along.norm();
        let direction = along / r;
        let cos_theta = direction.dot(&site.direction.cast()).clamp(-1.0, 1.0);
        let path = PathToPoint {
            photons: list.padded_photons(index, self.lines),
            incidence: self.response.incidence([target.x, target.y], &direction),
        };
        let table = self.lines.scattering(site.material);
        table.at(ScatterTable::locate(cos_theta), scattering);
        self.paths.coarse_between(&position, target, mass);
        let mut energies = self.energies(&path, scattering, mass, photons);
        if exact {
            self.paths.between_in_voxels(&position, target, mass);
            let inverse_share = f64::from(CORRECTION_INTERVAL);
            let exact = self.energies(&path, scattering, mass, photons);
            for (rough, exact) in energies.iter_mut().zip(exact) {
                *rough = [
                    rough.scaled(1.0 - inverse_share),
                    exact.scaled(inverse_share),
                ]
                .into_iter()
                .sum();
            }
        }
        energies.map(|part| part.scaled(along.z / (r * r * r)))
    }

    /// Energy that the photons of a collision deposit in the detector behind the masses `after` it, per solid angle; `photons` is a buffer.
    fn energies(
        &self,
        path: &PathToPoint,
        scattering: &LinesAtAngle,
        after: &BasisMass,
        photons: &mut Vec<f32>,
    ) -> [Moments; 2] {
        let [compton, rayleigh, compton_kev] = scattering.parts();
        photons.resize(path.photons.len(), 0.0);
        let arriving = path.photons.chunks_exact(WIDTH);
        let scattered = arriving.zip(compton.chunks_exact(WIDTH));
        for (chunk, (out, (arriving, compton))) in
            photons.chunks_exact_mut(WIDTH).zip(scattered).enumerate()
        {
            let energies = &compton_kev[chunk * WIDTH..][..WIDTH];
            let exponents: [f32; WIDTH] = std::array::from_fn(|lane| {
                self.paths.basis.exponent(after, f64::from(energies[lane]))
            });
            for lane in 0..WIDTH {
                out[lane] = arriving[lane] * compton[lane] * exp(-exponents[lane]);
            }
        }
        let compton = path.incidence.of_energies(compton_kev, photons);
        let arriving = path.photons.chunks_exact(WIDTH);
        let scattered = arriving.zip(rayleigh.chunks_exact(WIDTH));
        for (chunk, (out, (arriving, rayleigh))) in
            photons.chunks_exact_mut(WIDTH).zip(scattered).enumerate()
        {
            let exponents = exponents(after, self.lines.attenuation(), chunk * WIDTH);
            for lane in 0..WIDTH {
                out[lane] = arriving[lane] * rayleigh[lane] * exp(-exponents[lane]);
            }
        }
        [compton, path.incidence.of_lines(photons)]
    }
}
