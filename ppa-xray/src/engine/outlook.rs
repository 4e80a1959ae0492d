//! What collisions can be expected to send to a point of the detector, and which of them to look at closely.

use nalgebra::{Isometry3, Point3, Vector3};
use rayon::prelude::*;

use crate::engine::attenuation_basis::LANES;
use crate::engine::collision_map::CollisionMap;
use crate::engine::paths::{Paths, Step};
use crate::engine::scatter_table::ScatterTable;
use crate::matter::scatter_density::ScatterDensities;
use crate::phantom::voxels::VoxelPhantom;
use crate::transport::tracking::Transport;

/// Rays per side of a view, and depths along each.
const RAYS: usize = 32;
const DEPTHS: usize = 64;

/// Share of the choices that heeds no attenuation, so that no weight grows beyond bounds where a view errs.
const DEFENSIVE: f64 = 0.1;

/// What all views share.
pub(crate) struct Outlook<'a> {
    paths: &'a Paths<'a>,
    /// Attenuation of the coarse cells at the typical energy, 1/mm.
    mu_per_mm: Vec<f32>,
    /// Scattering at the typical energy, by material.
    scattering: Vec<ScatterTable>,
    corners: [Point3<f64>; 8],
    /// What photons mostly have in their way, and its attenuation at the typical energy.
    mass: Vec<[f32; LANES]>,
    typical_exponent: f32,
}

/// A photon about to scatter.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Site {
    pub position: Point3<f32>,
    pub direction: Vector3<f32>,
    /// What is scattered, relative to the sites beside it.
    pub strength: f32,
    /// Attenuation on the way out over that at the typical energy.
    pub hardness: f32,
    pub material: u8,
}

impl<'a> Outlook<'a> {
    /// The typical energy is that of photons that get through.
    pub fn new(
        transport: &Transport,
        paths: &'a Paths<'a>,
        densities: &[ScatterDensities],
        map: &CollisionMap,
    ) -> Self {
        let typical_kev = map.typical_kev;
        let node = transport.attenuation.locate(typical_kev);
        let device_from_ct: Isometry3<f64> = transport.projection.ct_from_device.inverse();
        let phantom: &VoxelPhantom = transport.phantom;
        Self {
            paths,
            mu_per_mm: paths.coarse_exponents(typical_kev),
            scattering: densities
                .iter()
                .enumerate()
                .map(|(material, densities)| {
                    let c = transport.attenuation.at(material as u8, node);
                    let tables = &transport.samplers[material];
                    ScatterTable::new(densities, tables, typical_kev, &c)
                })
                .collect(),
            corners: phantom.corners_ct().map(|corner| device_from_ct * corner),
            mass: map.mass.clone(),
            typical_exponent: paths.basis.exponent(&map.mass, typical_kev),
        }
    }

    /// Attenuation at an energy over that at the typical energy.
    pub fn hardness(&self, energy_kev: f64) -> f32 {
        if self.typical_exponent > 0.0 {
            self.paths.basis.exponent(&self.mass, energy_kev) / self.typical_exponent
        } else {
            1.0 // nothing in the way
        }
    }
}

impl Outlook<'_> {
    /// How much each site matters to points of the detector with given tolerances: the root of the sum of the squares of
    /// what it can be expected to send to each, in units of its tolerance.
    ///
    /// Sites drawn that often leave the least sum of squared errors in those units.
    pub fn importance(&self, sites: &[Site], points: &[(Point3<f64>, f64)]) -> Vec<f64> {
        // Fixed groups in fixed order: the sum is the same for any number of threads.
        let squares: Vec<Vec<f64>> = points
            .par_chunks(16)
            .map_init(View::default, |view, points| {
                let mut sums = vec![0.0; sites.len()];
                for (target, tolerance) in points {
                    view.look(self, target);
                    for (sum, site) in sums.iter_mut().zip(sites) {
                        let seen = f64::from(view.expected(self, site)[1]) / tolerance;
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

/// The body as one point of the detector sees it: optical depths along rays from there, at the typical energy.
///
/// Directions are counted in stereographic coordinates, which have no pole on this side of the detector plane.
#[derive(Debug)]
pub(crate) struct View {
    target: Point3<f32>,
    low: [f32; 2],
    /// Rays per unit of the coordinates.
    per_unit: [f32; 2],
    near_mm: f32,
    depths_per_mm: f32,
    depths: Vec<f32>,
    /// For every site: what it would send with nothing in the way, and what with what there is.
    expected: Vec<[f32; 2]>,
}

impl Default for View {
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

impl View {
    /// Looks at the body from `target`.
    pub fn look(&mut self, outlook: &Outlook, target: &Point3<f64>) {
        self.target = target.cast();
        let corners = outlook.corners.map(|corner| corner - target);
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
            outlook.paths.coarse_pieces(
                target,
                &direction,
                near_mm + step_mm * DEPTHS as f64,
                |cell, from_mm, to_mm| {
                    let mu = outlook.mu_per_mm[cell];
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

    /// Chooses sites by what they can be expected to send here, `count` in the mean, by even steps from a start that `u`
    /// stands for; tells the index of each and the inverse of how often it can be expected to be chosen.
    ///
    /// Only every so many-th site from `first` on is considered.
    pub fn choose(
        &mut self,
        outlook: &Outlook,
        sites: &[Site],
        (first, every): (usize, usize),
        (count, u): (f64, f64),
        mut chosen: impl FnMut(usize, f64),
    ) {
        let mut expected = std::mem::take(&mut self.expected);
        expected.clear();
        let considered = sites.iter().skip(first).step_by(every);
        expected.extend(considered.map(|site| self.expected(outlook, site)));
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
    fn expected(&self, outlook: &Outlook, site: &Site) -> [f32; 2] {
        let along = self.target - site.position;
        let square = along.norm_squared();
        let r = square.sqrt();
        let cos_theta = f64::from(along.dot(&site.direction) / r);
        let scattering =
            outlook.scattering[usize::from(site.material)].at(ScatterTable::locate(cos_theta));
        let bare = site.strength
            * (scattering.compton + scattering.rayleigh) as f32
            * (along.z / (r * square)).max(0.0);
        [bare, bare * (-self.depth(&along, r) * site.hardness).exp()]
    }

    /// Optical depth between here and a site, `along` from there to here.
    #[inline]
    fn depth(&self, along: &Vector3<f32>, r: f32) -> f32 {
        let scale = -1.0 / (r + along.z);
        let [(i, right), (j, up)] = [0, 1].map(|axis| {
            let at = (along[axis] * scale - self.low[axis]) * self.per_unit[axis];
            let at = at.clamp(0.0, (RAYS - 1) as f32);
            let ray = (at as usize).min(RAYS - 2);
            (ray, at - ray as f32)
        });
        let at = ((r - self.near_mm) * self.depths_per_mm).clamp(0.0, (DEPTHS - 1) as f32);
        let k = (at as usize).min(DEPTHS - 2);
        let deep = at - k as f32;
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

/// Coordinates of a direction towards −z.
fn stereographic(direction: &Vector3<f64>) -> [f64; 2] {
    let scale = 1.0 / (direction.norm() - direction.z);
    [direction.x * scale, direction.y * scale]
}
