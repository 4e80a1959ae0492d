//! Photons scattered twice or more, and K x-rays: next-event estimation from [`later_collisions`](super::later_collisions).
//!
//! Kalos, Nucl. Sci. Eng. 16 (1963) 111; docs/physics.md, "Fast engine", multiple scatter.

use nalgebra::Point3;
use ppa_core::random::Philox;
use rayon::prelude::*;

use crate::detector::tabulated_response::TabulatedResponse;
use crate::engine::attenuation_basis::BasisMass;
use crate::engine::attenuation_basis::LANES;
use crate::engine::expected_scores::Subset;
use crate::engine::fast_progress::{Monitor, SINGLE_DONE};
use crate::engine::importance::{Draws, PointImportance};
use crate::engine::later_collisions::{Event, Histories, LaterCollisions};
use crate::engine::node_grid::NodeGrid;
use crate::matter::scatter_density::ScatterDensities;
use crate::transport::attenuation::Coefficients;
use crate::transport::stream::Stream;
use crate::transport::tally::Moments;
use crate::vector_math::exp;

/// Largest number of histories per list whose collisions are stored at the same time.
const ROUND: u64 = 8_192;

/// Number of histories per collision that a node samples.
const HISTORIES_PER_SAMPLE: f64 = 16.0;

/// One sample in this many is repeated through the voxels themselves; the difference, times this number, corrects the
/// average error of the coarse cells.
const CORRECTION_INTERVAL: u32 = 8;

/// Solid angle of all directions, sr.
const SPHERE: f64 = 4.0 * std::f64::consts::PI;

/// Histories, and the points of the detector that sample their collisions.
pub(crate) struct MultipleScatter<'a> {
    pub histories: Histories<'a>,
    pub response: &'a TabulatedResponse<'a>,
    pub densities: &'a [ScatterDensities],
    pub nodes: NodeGrid,
}

/// Energy per cm² and history that multiple scatter deposits in the detector, at every node.
pub(crate) struct NodeFluence {
    /// List by list.
    pub fluence: Vec<Vec<Moments>>,
    /// Largest share of a single sample in a node's sum.
    pub largest_share: f64,
}

/// Sums of a node.
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
    importance: PointImportance,
    mass: Vec<[f32; LANES]>,
}

impl MultipleScatter<'_> {
    /// Follows histories from all listed collisions.
    pub fn fluence(&self, seed: u64, monitor: &Monitor) -> NodeFluence {
        let (each, lists) = (self.histories.each(), self.histories.lists.len());
        let start = NodeSum {
            sums: vec![Moments::default(); lists],
            largest: 0.0,
        };
        let mut nodes = vec![start; self.nodes.nodes()];
        let rounds = each.div_ceil(ROUND) as usize;
        let phase = monitor.phase(SINGLE_DONE..1.0, rounds * (lists + nodes.len()));
        for (round, first) in (0..each).step_by(ROUND as usize).enumerate() {
            if phase.is_cancelled() {
                break;
            }
            let histories = first..(first + ROUND).min(each);
            let samples = (histories.end - histories.start) as f64 / HISTORIES_PER_SAMPLE;
            let collisions: Vec<LaterCollisions> = (0..lists)
                .into_par_iter()
                .map(|list| {
                    phase.advance();
                    self.histories
                        .collisions(seed, list, histories.clone(), each)
                })
                .collect();
            nodes.par_iter_mut().enumerate().for_each_init(
                Scratch::default,
                |scratch, (node, sum)| {
                    if phase.is_cancelled() {
                        return;
                    }
                    phase.advance();
                    let index = (round * self.nodes.nodes() + node) as u64;
                    let stream = Stream::MultipleScatterSampling as u32;
                    let mut rng = Philox::new(seed, stream, index);
                    self.add_samples(node, &collisions, samples, sum, scratch, &mut rng);
                },
            );
        }
        let whole = |node: &NodeSum| node.sums.iter().map(|sum| sum.mean_kev).sum::<f64>();
        NodeFluence {
            largest_share: nodes
                .iter()
                .map(|node| node.largest / whole(node).max(f64::MIN_POSITIVE))
                .fold(0.0, f64::max),
            fluence: (0..lists)
                .map(|list| nodes.iter().map(|node| node.sums[list]).collect())
                .collect(),
        }
    }

    /// Adds about `samples` collisions of every list, sampled by importance, to a node.
    fn add_samples(
        &self,
        node: usize,
        collisions: &[LaterCollisions],
        samples: f64,
        sum: &mut NodeSum,
        Scratch { importance, mass }: &mut Scratch,
        rng: &mut Philox,
    ) {
        let at = self.nodes.place(node);
        let target = Point3::new(
            at.x,
            at.y,
            self.histories.transport.projection.source_detector_mm,
        );
        mass.resize(self.histories.paths.basis.groups, [0.0; LANES]);
        importance.tabulate(self.histories.importance_model, &target);
        for (collisions, part) in collisions.iter().zip(&mut sum.sums) {
            let draws = Draws {
                count: samples,
                u: rng.unit(),
            };
            let all = Subset { first: 0, every: 1 };
            importance.sample(
                self.histories.importance_model,
                &collisions.sites,
                all,
                draws,
                |index, inverse| {
                    let sample = self.contribution(&target, collisions, index, mass, rng);
                    // mm² → cm²
                    let sample = sample.scaled(100.0 * inverse);
                    *part = [*part, sample].into_iter().sum();
                    sum.largest = sum.largest.max(sample.mean_kev.abs());
                },
            );
        }
    }

    /// Contribution of a photon about to collide to `target`, per mm².
    fn contribution(
        &self,
        target: &Point3<f64>,
        collisions: &LaterCollisions,
        index: usize,
        mass: &mut BasisMass,
        rng: &mut Philox,
    ) -> Moments {
        let site = &collisions.sites[index];
        let material = usize::from(site.material);
        let position = site.position.cast::<f64>();
        let along = target - position;
        let r = along.norm();
        let direction = along / r;
        let attenuation = &self.histories.transport.tables.attenuation;
        let tables = &self.histories.transport.tables.samplers[material];
        let incidence = self.response.incidence([target.x, target.y], &direction);
        // Energies of photons towards the target, with the energy deposited by each per solid angle.
        let left = |energy_kev: f64, per_sr: f64| {
            (energy_kev, incidence.of_energy(energy_kev).scaled(per_sr))
        };
        let k_ray =
            |c: &Coefficients, line_kev: f64| left(line_kev, f64::from(c.photoelectric) / SPHERE);
        let kinds = match collisions.events[index] {
            Event::KRay {
                absorbed_kev,
                line_kev,
            } => {
                let c = attenuation.at(site.material, attenuation.locate(absorbed_kev.into()));
                [Some(k_ray(&c, line_kev.into())), None, None]
            }
            Event::Any { energy_kev } => {
                let energy_kev = f64::from(energy_kev);
                let c = attenuation.at(site.material, attenuation.locate(energy_kev));
                let densities = &self.densities[material];
                let cos_theta = direction.dot(&site.direction.cast()).clamp(-1.0, 1.0);
                let scattered_kev = tables.compton_energy_at(energy_kev, cos_theta, || rng.unit());
                let compton = f64::from(c.with_compton - c.photoelectric)
                    * densities.compton_density(energy_kev, cos_theta);
                let rayleigh = f64::from(c.total - c.with_compton)
                    * densities.rayleigh_density(energy_kev, cos_theta);
                let line_kev = tables.k_fluorescence(energy_kev, rng.unit());
                [
                    Some(left(scattered_kev, compton)),
                    Some(left(energy_kev, rayleigh)),
                    line_kev.map(|line_kev| k_ray(&c, line_kev)),
                ]
            }
        };
        let through = |mass: &BasisMass| -> Moments {
            kinds
                .iter()
                .flatten()
                .map(|(energy_kev, left)| {
                    let exponent = self.histories.paths.basis.exponent(mass, *energy_kev);
                    left.scaled(f64::from(exp(-exponent)))
                })
                .sum()
        };
        self.histories.paths.coarse_between(&position, target, mass);
        let mut part = through(mass);
        if !self.histories.paths.coarse_is_exact()
            && rng.unit() * f64::from(CORRECTION_INTERVAL) < 1.0
        {
            self.histories
                .paths
                .between_in_voxels(&position, target, mass);
            let inverse_share = f64::from(CORRECTION_INTERVAL);
            let exact = through(mass).scaled(inverse_share);
            part = [part.scaled(1.0 - inverse_share), exact].into_iter().sum();
        }
        part.scaled(f64::from(site.weight) * along.z / (r * r * r))
    }
}
