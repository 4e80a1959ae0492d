//! Importance model of a detector point: the approximate expected contribution of a collision, used for sampling collisions.
//!
//! Approximation: one energy, optical depths interpolated from a table of rays from the point. It is used only as a sampling density, mixed
//! with the unattenuated contribution (defensive sampling, Hesterberg, Technometrics 37 (1995) 185), so estimates stay unbiased.
//! docs/physics.md, "Fast engine", single scatter.

use nalgebra::{Isometry3, Point3};
use rayon::prelude::*;

use crate::engine::attenuation_basis::LANES;
use crate::engine::collision_map::CollisionMap;
use crate::engine::depth_table::DepthTable;
use crate::engine::expected_scores::{ExpectedScores, Subset};
use crate::engine::paths::Paths;
use crate::engine::scatter_table::ScatterTable;
use crate::engine::site::Site;
use crate::isa::Isa;
use crate::matter::scatter_density::ScatterDensities;
use crate::transport::tracking::Transport;

/// Share of the samples drawn without regard to attenuation, which bounds the weights where the model underestimates.
const DEFENSIVE: f64 = 0.1;

/// Data shared by the importance of all points.
pub(crate) struct ImportanceModel<'a> {
    paths: &'a Paths<'a>,
    /// Attenuation of the coarse cells at the typical energy, 1/mm.
    mu_per_mm: Vec<f32>,
    /// Compton and Rayleigh scattering together at the typical energy, by angle, material by material.
    scattering: Vec<f32>,
    corners: [Point3<f64>; 8],
    /// Mean mass on the path of the photons, and its attenuation at the typical energy.
    mass: Vec<[f32; LANES]>,
    typical_exponent: f32,
}

impl<'a> ImportanceModel<'a> {
    /// The typical energy is that of the transmitted photons.
    pub fn new(
        transport: &Transport,
        paths: &'a Paths<'a>,
        densities: &[ScatterDensities],
        map: &CollisionMap,
    ) -> Self {
        let typical_kev = map.typical_kev;
        let node = transport.tables.attenuation.locate(typical_kev);
        let device_from_ct: Isometry3<f64> = transport.projection.ct_from_device.inverse();
        let phantom = &*transport.tables.phantom;
        Self {
            paths,
            mu_per_mm: paths.coarse_exponents(typical_kev),
            scattering: densities
                .iter()
                .enumerate()
                .flat_map(|(material, densities)| {
                    let c = transport.tables.attenuation.at(material as u8, node);
                    let tables = &transport.tables.samplers[material];
                    ScatterTable::new(densities, tables, typical_kev, &c).in_all()
                })
                .collect(),
            corners: phantom.corners_ct().map(|corner| device_from_ct * corner),
            mass: map.mass.clone(),
            typical_exponent: paths.basis.exponent(&map.mass, typical_kev),
        }
    }

    /// Ratio of the attenuation at an energy to that at the typical energy.
    pub fn attenuation_ratio(&self, energy_kev: f64) -> f32 {
        if self.typical_exponent > 0.0 {
            self.paths.basis.exponent(&self.mass, energy_kev) / self.typical_exponent
        } else {
            1.0 // nothing in the way
        }
    }
}

impl ImportanceModel<'_> {
    /// Importance of each site for points of the detector with given tolerances: the square root of the summed squares of its
    /// expected contributions, each in units of the tolerance.
    ///
    /// Sampling in proportion to it minimises the sum of squared errors in those units.
    pub fn importance(&self, sites: &[Site], points: &[(Point3<f64>, f64)]) -> Vec<f64> {
        // Fixed groups in fixed order, so that the sum is the same for any number of threads.
        let squares: Vec<Vec<f64>> = points
            .par_chunks(16)
            .map_init(PointImportance::default, |importance, points| {
                let mut sums = vec![0.0; sites.len()];
                for (target, tolerance) in points {
                    importance.tabulate(self, target);
                    let scores = importance.scores(self, sites, Subset { first: 0, every: 1 });
                    for (sum, [_, seen]) in sums.iter_mut().zip(scores) {
                        let seen = f64::from(*seen) / tolerance;
                        *sum += seen * seen;
                    }
                }
                sums
            })
            .collect();
        (0..sites.len())
            .map(|site| squares.iter().map(|sums| sums[site]).sum::<f64>().sqrt())
            .collect()
    }
}

/// A systematic sample: the mean number of draws, and its random start in [0, 1).
#[derive(Debug, Clone, Copy)]
pub(crate) struct Draws {
    pub count: f64,
    pub u: f64,
}

/// Importance of collisions for one point of the detector.
#[derive(Default)]
pub(crate) struct PointImportance {
    target: Point3<f32>,
    depths: DepthTable,
    /// Scores of every site, without and with attenuation.
    scores: Vec<[f32; 2]>,
}

impl PointImportance {
    /// Tabulates the optical depths of the body from `target`.
    pub fn tabulate(&mut self, importance_model: &ImportanceModel, target: &Point3<f64>) {
        let ImportanceModel {
            paths,
            mu_per_mm,
            corners,
            ..
        } = importance_model;
        self.target = target.cast();
        self.depths.tabulate(paths, mu_per_mm, corners, target);
    }

    /// Expected scores of the sites of a subset, without and with attenuation.
    fn scores(
        &mut self,
        importance_model: &ImportanceModel,
        sites: &[Site],
        subset: Subset,
    ) -> &[[f32; 2]] {
        self.scores.resize(subset.count(sites.len()), [0.0; 2]);
        Isa::widest().run(ExpectedScores {
            target: self.target,
            depths: &self.depths,
            scattering: &importance_model.scattering,
            sites,
            subset,
            scores: &mut self.scores,
        });
        &self.scores
    }

    /// Samples sites in proportion to their expected contribution, `count` on average, by systematic sampling with the random
    /// start `u`. Passes on the index of each site and its weight, the inverse of the expected number of times it is drawn.
    ///
    /// Only sites `first`, `first + every` and so on take part.
    pub fn sample(
        &mut self,
        importance_model: &ImportanceModel,
        sites: &[Site],
        subset: Subset,
        draws: Draws,
        mut chosen: impl FnMut(usize, f64),
    ) {
        let Draws { count, u } = draws;
        let scores = self.scores(importance_model, sites, subset);
        let mut sums = [0.0_f64; 2];
        for both in scores {
            sums[0] += f64::from(both[0]);
            sums[1] += f64::from(both[1]);
        }
        let defensive = if sums[1] > 0.0 { DEFENSIVE } else { 1.0 };
        let bare = defensive * count / sums[0].max(f64::MIN_POSITIVE);
        let seen = (1.0 - defensive) * count / sums[1].max(f64::MIN_POSITIVE);
        let (mut at, mut next) = (0.0, u);
        for (index, both) in scores.iter().enumerate() {
            let times = bare * f64::from(both[0]) + seen * f64::from(both[1]);
            at += times;
            let mut drawn = 0.0;
            while next < at {
                drawn += 1.0;
                next += 1.0;
            }
            if drawn > 0.0 {
                chosen(subset.first + index * subset.every, drawn / times);
            }
        }
    }
}
