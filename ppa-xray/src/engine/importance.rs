//! Importance model of a detector point: the approximate expected contribution of a collision, to sample collisions by.
//!
//! Approximation: one energy, optical depths interpolated from a table of rays from the point. It is used as a sampling density only, mixed
//! with the unattenuated contribution (defensive sampling, Hesterberg, Technometrics 37 (1995) 185), so estimates stay unbiased.
//! docs/physics.md, "Fast engine", single scatter.

use nalgebra::{Isometry3, Point3, Vector3};
use rayon::prelude::*;

use crate::engine::attenuation_basis::LANES;
use crate::engine::cell_walk::Step;
use crate::engine::collision_map::CollisionMap;
use crate::engine::paths::Paths;
use crate::engine::scatter_table::ScatterTable;
use crate::engine::site::Site;
use crate::matter::scatter_density::ScatterDensities;
use crate::transport::tracking::Transport;
use crate::vector_math::exp;

/// Rays per side of the table of a point, and depths along each.
const RAYS: usize = 32;
const DEPTHS: usize = 64;

/// Share of the samples drawn without regard to attenuation, which bounds the weights where the model underestimates.
const DEFENSIVE: f64 = 0.1;

/// What the importance of all points has in common.
pub(crate) struct ImportanceModel<'a> {
    paths: &'a Paths<'a>,
    /// Attenuation of the coarse cells at the typical energy, 1/mm.
    mu_per_mm: Vec<f32>,
    /// Scattering at the typical energy, by material.
    scattering: Vec<ScatterTable>,
    corners: [Point3<f64>; 8],
    /// Mean mass on the way of the photons, and its attenuation at the typical energy.
    mass: Vec<[f32; LANES]>,
    typical_exponent: f32,
}

impl<'a> ImportanceModel<'a> {
    /// The typical energy is that of photons that get through.
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
                .map(|(material, densities)| {
                    let c = transport.tables.attenuation.at(material as u8, node);
                    let tables = &transport.tables.samplers[material];
                    ScatterTable::new(densities, tables, typical_kev, &c)
                })
                .collect(),
            corners: phantom.corners_ct().map(|corner| device_from_ct * corner),
            mass: map.mass.clone(),
            typical_exponent: paths.basis.exponent(&map.mass, typical_kev),
        }
    }

    /// Attenuation at an energy over that at the typical energy.
    pub fn attenuation_ratio(&self, energy_kev: f64) -> f32 {
        if self.typical_exponent > 0.0 {
            self.paths.basis.exponent(&self.mass, energy_kev) / self.typical_exponent
        } else {
            1.0 // nothing in the way
        }
    }
}

impl ImportanceModel<'_> {
    /// Importance of each site for points of the detector with given tolerances: the root of the summed squares of its
    /// expected contributions, each in units of the tolerance.
    ///
    /// Sampling in proportion to it minimises the sum of squared errors in those units.
    pub fn importance(&self, sites: &[Site], points: &[(Point3<f64>, f64)]) -> Vec<f64> {
        // Fixed groups in fixed order: the sum is the same for any number of threads.
        let squares: Vec<Vec<f64>> = points
            .par_chunks(16)
            .map_init(PointImportance::default, |importance, points| {
                let mut sums = vec![0.0; sites.len()];
                for (target, tolerance) in points {
                    importance.tabulate(self, target);
                    for (sum, site) in sums.iter_mut().zip(sites) {
                        let seen = f64::from(importance.expected(self, site)[1]) / tolerance;
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

/// Every `every`-th site from `first` on.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Subset {
    pub first: usize,
    pub every: usize,
}

/// A systematic sample: the mean number of draws, and its random start in [0, 1).
#[derive(Debug, Clone, Copy)]
pub(crate) struct Draws {
    pub count: f64,
    pub u: f64,
}

/// Importance of collisions for one point of the detector: a table of optical depths along rays from there, at the typical energy.
///
/// Directions are counted in stereographic coordinates, which have no pole on this side of the detector plane.
#[derive(Debug)]
pub(crate) struct PointImportance {
    target: Point3<f32>,
    low: [f32; 2],
    /// Rays per unit of the coordinates.
    per_unit: [f32; 2],
    near_mm: f32,
    depths_per_mm: f32,
    depths: Vec<f32>,
    /// Expected contribution of every site without and with attenuation.
    expected: Vec<[f32; 2]>,
}

impl Default for PointImportance {
    fn default() -> Self {
        Self {
            target: Point3::origin(),
            low: [0.0; 2],
            per_unit: [0.0; 2],
            near_mm: 0.0,
            depths_per_mm: 0.0,
            depths: vec![0.0; RAYS * RAYS * DEPTHS],
            expected: Vec::new(),
        }
    }
}

impl PointImportance {
    /// Tabulates the optical depths of the body from `target`.
    pub fn tabulate(&mut self, importance_model: &ImportanceModel, target: &Point3<f64>) {
        self.target = target.cast();
        let corners = importance_model.corners.map(|corner| corner - target);
        let middle: Vector3<f64> = corners.iter().sum::<Vector3<f64>>() / 8.0;
        let radius_mm = (corners[0] - middle).norm();
        let near_mm = (middle.norm() - radius_mm).max(0.0);
        let step_mm = (middle.norm() + radius_mm - near_mm) / (DEPTHS - 1) as f64;
        let low_high = if corners.iter().any(|corner| corner.z >= 0.0) {
            [[-1.0, 1.0]; 2] // the box reaches behind the plane: all directions before it
        } else {
            let seen = corners.map(|corner| stereographic(&corner));
            [0, 1].map(|axis| {
                let along = seen.map(|at| at[axis]);
                let low = along.iter().copied().fold(f64::INFINITY, f64::min);
                [low, along.iter().copied().fold(-f64::INFINITY, f64::max)]
            })
        };
        let pitch = low_high.map(|[low, high]| (high - low).max(1e-6) / (RAYS - 1) as f64);
        self.low = low_high.map(|[low, _]| low as f32);
        self.per_unit = pitch.map(|pitch| (1.0 / pitch) as f32);
        self.near_mm = near_mm as f32;
        self.depths_per_mm = (1.0 / step_mm) as f32;
        for (ray, depths) in self.depths.chunks_exact_mut(DEPTHS).enumerate() {
            let at = [ray % RAYS, ray / RAYS];
            let [x, y] = [0, 1].map(|axis| low_high[axis][0] + at[axis] as f64 * pitch[axis]);
            let square = x * x + y * y;
            let direction = Vector3::new(2.0 * x, 2.0 * y, square - 1.0) / (1.0 + square);
            let (mut depth, mut next) = (0.0_f32, 0);
            importance_model.paths.coarse_pieces(
                target,
                &direction,
                near_mm + step_mm * DEPTHS as f64,
                |cell, from_mm, to_mm| {
                    let mu = importance_model.mu_per_mm[cell];
                    while next < DEPTHS {
                        let at_mm = near_mm + step_mm * next as f64;
                        if at_mm >= to_mm {
                            break;
                        }
                        depths[next] = depth + mu * (at_mm - from_mm).max(0.0) as f32;
                        next += 1;
                    }
                    depth += mu * (to_mm - from_mm) as f32;
                    Step::Continue(())
                },
            );
            depths[next..].fill(depth);
        }
    }

    /// Samples sites in proportion to their expected contribution, `count` on average, by systematic sampling with the random
    /// start `u`; passes on the index of each and its weight, the inverse of the expected number of times it is drawn.
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
        let Subset { first, every } = subset;
        let Draws { count, u } = draws;
        let mut expected = std::mem::take(&mut self.expected);
        expected.clear();
        let considered = sites.iter().skip(first).step_by(every);
        expected.extend(considered.map(|site| self.expected(importance_model, site)));
        let mut sums = [0.0_f64; 2];
        for both in &expected {
            sums[0] += f64::from(both[0]);
            sums[1] += f64::from(both[1]);
        }
        let defensive = if sums[1] > 0.0 { DEFENSIVE } else { 1.0 };
        let bare = defensive * count / sums[0].max(f64::MIN_POSITIVE);
        let seen = (1.0 - defensive) * count / sums[1].max(f64::MIN_POSITIVE);
        let (mut at, mut next) = (0.0, u);
        for (index, both) in expected.iter().enumerate() {
            let times = bare * f64::from(both[0]) + seen * f64::from(both[1]);
            at += times;
            let mut drawn = 0.0;
            while next < at {
                drawn += 1.0;
                next += 1.0;
            }
            if drawn > 0.0 {
                chosen(first + index * every, drawn / times);
            }
        }
        self.expected = expected;
    }

    #[inline]
    fn expected(&self, importance_model: &ImportanceModel, site: &Site) -> [f32; 2] {
        let along = self.target - site.position;
        let square = along.norm_squared();
        let r = square.sqrt();
        let cos_theta = f64::from(along.dot(&site.direction) / r);
        let scattering = importance_model.scattering[usize::from(site.material)]
            .at(ScatterTable::locate(cos_theta));
        let bare = site.weight
            * (scattering.compton + scattering.rayleigh) as f32
            * (along.z / (r * square)).max(0.0);
        [
            bare,
            bare * exp(-self.depth(&along, r) * site.attenuation_ratio),
        ]
    }

    /// Optical depth between here and a site, `along` from there to here.
    #[inline]
    fn depth(&self, along: &Vector3<f32>, r: f32) -> f32 {
        let scale = -1.0 / (r + along.z);
        let [i, j, k] = [
            (along.x * scale - self.low[0]) * self.per_unit[0],
            (along.y * scale - self.low[1]) * self.per_unit[1],
            (r - self.near_mm) * self.depths_per_mm,
        ];
        let ((i, right), (j, up)) = (between_nodes(i, RAYS), between_nodes(j, RAYS));
        let (k, deep) = between_nodes(k, DEPTHS);
        let on_ray = |i: usize, j: usize| {
            let ray = (j * RAYS + i) * DEPTHS + k;
            let (low, high) = (self.depths[ray], self.depths[ray + 1]);
            low + deep * (high - low)
        };
        let below = on_ray(i, j) + right * (on_ray(i + 1, j) - on_ray(i, j));
        let above = on_ray(i, j + 1) + right * (on_ray(i + 1, j + 1) - on_ray(i, j + 1));
        below + up * (above - below)
    }
}

/// The lower of the two of `count` nodes about a place, and how far from there to the upper one it is.
#[inline(always)]
fn between_nodes(at: f32, count: usize) -> (usize, f32) {
    let at = at.clamp(0.0, (count - 1) as f32);
    let node = (at as usize).min(count - 2);
    (node, at - node as f32)
}

/// Coordinates of a direction towards −z.
fn stereographic(direction: &Vector3<f64>) -> [f64; 2] {
    let scale = 1.0 / (direction.norm() - direction.z);
    [direction.x * scale, direction.y * scale]
}
