//! Expected scores of many collision sites at one point of the detector: vectorised evaluation of its importance model.
//!
//! docs/physics.md, "Fast engine", single scatter.

use nalgebra::Point3;

use crate::engine::depth_table::{DEPTHS, DepthTable, RAYS};
use crate::engine::scatter_table::STEPS;
use crate::engine::site::Site;
use crate::isa::Kernel;
use crate::vector_math::{exp, floor, greatest, least};

/// Number of sites processed together.
const CHUNK: usize = 64;

/// Every `every`-th site from `first` on.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Subset {
    pub first: usize,
    pub every: usize,
}

impl Subset {
    /// Number of sites in the subset, out of `sites`.
    pub fn count(&self, sites: usize) -> usize {
        sites.saturating_sub(self.first).div_ceil(self.every)
    }
}

/// Scores of a subset of sites at the point that a table of optical depths was made for.
pub(super) struct ExpectedScores<'a> {
    pub target: Point3<f32>,
    pub depths: &'a DepthTable,
    /// Compton and Rayleigh scattering together at [`STEPS`] + 1 angles, material by material.
    pub scattering: &'a [f32],
    pub sites: &'a [Site],
    pub subset: Subset,
    /// Scores without and with attenuation on the way to the point, one pair for each site of the subset.
    pub scores: &'a mut [[f32; 2]],
}

impl Kernel for ExpectedScores<'_> {
    #[inline(always)]
    fn run(self) {
        let Subset { first, every } = self.subset;
        let DepthTable {
            low: [low_x, low_y],
            per_unit: [per_x, per_y],
            near_mm,
            depths_per_mm,
            ref depths,
        } = *self.depths;
        let [target_x, target_y, target_z] = self.target.into();
        for (chunk, scores) in self.scores.chunks_mut(CHUNK).enumerate() {
            let [mut x, mut y, mut z] = [[0.0; CHUNK]; 3];
            let [mut along_x, mut along_y, mut along_z] = [[0.0; CHUNK]; 3];
            let [mut weight, mut attenuation_ratio] = [[0.0; CHUNK]; 2];
            let mut row = [0_u32; CHUNK];
            for lane in 0..CHUNK {
                // The last chunk repeats the last site.
                let number = chunk * CHUNK + lane.min(scores.len() - 1);
                let site = &self.sites[first + number * every];
                [x[lane], y[lane], z[lane]] = site.position.into();
                [along_x[lane], along_y[lane], along_z[lane]] = site.direction.into();
                weight[lane] = site.weight;
                attenuation_ratio[lane] = site.attenuation_ratio;
                row[lane] = u32::from(site.material) * (STEPS as u32 + 1);
            }
            // From site to point.
            let [mut r, mut cos_theta] = [[0.0; CHUNK]; 2];
            for lane in 0..CHUNK {
                x[lane] = target_x - x[lane];
                y[lane] = target_y - y[lane];
                z[lane] = target_z - z[lane];
                let square = x[lane] * x[lane] + y[lane] * y[lane] + z[lane] * z[lane];
                r[lane] = square.sqrt();
                let along =
                    x[lane] * along_x[lane] + y[lane] * along_y[lane] + z[lane] * along_z[lane];
                cos_theta[lane] = along / r[lane];
                weight[lane] *= greatest(z[lane] / (r[lane] * square), 0.0);
            }
            let mut step = [0.0; CHUNK];
            for lane in 0..CHUNK {
                let at = greatest(0.5 * (1.0 - cos_theta[lane]), 0.0).sqrt() * STEPS as f32;
                let (whole, index) = floor(least(at, (STEPS - 1) as f32));
                row[lane] += index;
                step[lane] = at - whole;
            }
            let [mut right, mut up, mut deep] = [[0.0; CHUNK]; 3];
            let mut node = [0_u32; CHUNK];
            for lane in 0..CHUNK {
                // Stereographic coordinates of the direction from the point to the site.
                let scale = -1.0 / (r[lane] + z[lane]);
                let (i, between_i) = between_nodes((x[lane] * scale - low_x) * per_x, RAYS);
                let (j, between_j) = between_nodes((y[lane] * scale - low_y) * per_y, RAYS);
                let (k, between_k) = between_nodes((r[lane] - near_mm) * depths_per_mm, DEPTHS);
                right[lane] = between_i;
                up[lane] = between_j;
                deep[lane] = between_k;
                node[lane] = (j * RAYS as u32 + i) * DEPTHS as u32 + k;
            }
            let mut scattering = [[0.0; CHUNK]; 2];
            let mut corners = [[[0.0; CHUNK]; 2]; 4];
            for lane in 0..CHUNK {
                let pair = &self.scattering[row[lane] as usize..][..2];
                for (values, value) in scattering.iter_mut().zip(pair) {
                    values[lane] = *value;
                }
                for (corner, ray) in corners.iter_mut().zip([0, 1, RAYS, RAYS + 1]) {
                    let pair = &depths[node[lane] as usize + ray * DEPTHS..][..2];
                    for (values, depth) in corner.iter_mut().zip(pair) {
                        values[lane] = *depth;
                    }
                }
            }
            let [mut bare, mut seen] = [[0.0; CHUNK]; 2];
            for lane in 0..CHUNK {
                let [a, b, c, d] = [0, 1, 2, 3]
                    .map(|ray| between(corners[ray][0][lane], corners[ray][1][lane], deep[lane]));
                let depth = between(
                    between(a, b, right[lane]),
                    between(c, d, right[lane]),
                    up[lane],
                );
                let scattered = between(scattering[0][lane], scattering[1][lane], step[lane]);
                bare[lane] = weight[lane] * scattered;
                seen[lane] = bare[lane] * exp(-depth * attenuation_ratio[lane]);
            }
            for (lane, score) in scores.iter_mut().enumerate() {
                *score = [bare[lane], seen[lane]];
            }
        }
    }
}

/// The lower of the two nodes next to a position, out of `count`, and the fraction of the interval above it.
#[inline(always)]
fn between_nodes(at: f32, count: usize) -> (u32, f32) {
    let at = least(greatest(at, 0.0), (count - 1) as f32);
    let (whole, node) = floor(least(at, (count - 2) as f32));
    (node, at - whole)
}

#[inline(always)]
fn between(low: f32, high: f32, share: f32) -> f32 {
    low + share * (high - low)
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;
    use ppa_core::random::Philox;

    use super::*;
    use crate::isa::Isa;

    /// A table whose depths are linear in its coordinates, so that interpolation is exact.
    fn depths() -> DepthTable {
        let mut table = DepthTable {
            low: [-0.4; 2],
            per_unit: [38.75; 2],
            near_mm: 50.0,
            depths_per_mm: 0.2,
            ..DepthTable::default()
        };
        for (node, depth) in table.depths.iter_mut().enumerate() {
            let (i, j, k) = (node / DEPTHS % RAYS, node / (DEPTHS * RAYS), node % DEPTHS);
            *depth = 0.02 * i as f32 + 0.01 * j as f32 + 0.03 * k as f32;
        }
        table
    }

    fn scattering(material: usize, half_sine: f64) -> f64 {
        (1.0 + material as f64) * (2.0 - half_sine)
    }

    fn sites(count: u64, target: Point3<f32>) -> Vec<Site> {
        let site = |index| {
            let mut rng = Philox::new(3, 0, index);
            let mut between = |low: f64, high: f64| (low + rng.unit() * (high - low)) as f32;
            let away = Vector3::new(
                between(-80.0, 80.0),
                between(-80.0, 80.0),
                between(-300.0, -120.0),
            );
            let direction = [(); 3].map(|()| between(-1.0, 1.0));
            Site {
                position: target + away,
                direction: Vector3::from(direction).normalize(),
                weight: between(0.1, 2.0),
                attenuation_ratio: between(0.8, 1.2),
                material: (index % 2) as u8,
            }
        };
        (0..count).map(site).collect()
    }

    /// The formula, in double precision.
    fn score(site: &Site, target: &Point3<f32>) -> [f64; 2] {
        let along = (target - site.position).cast::<f64>();
        let r = along.norm();
        let cos_theta = along.dot(&site.direction.cast()) / r;
        let half_sine = (0.5 * (1.0 - cos_theta)).sqrt();
        let node = |axis: usize| (-along[axis] / (r + along.z) + 0.4) * 38.75;
        let depth = 0.02 * node(0) + 0.01 * node(1) + 0.03 * (r - 50.0) * 0.2;
        let bare = f64::from(site.weight) * scattering(site.material.into(), half_sine) * along.z
            / r.powi(3);
        [
            bare,
            bare * (-depth * f64::from(site.attenuation_ratio)).exp(),
        ]
    }

    #[test]
    fn scores_follow_the_formula_on_all_machines() {
        let target = Point3::new(10.0, -5.0, 1_000.0);
        let table = depths();
        let scattering: Vec<f32> = (0..2 * (STEPS + 1))
            .map(|row| {
                let half_sine = (row % (STEPS + 1)) as f64 / STEPS as f64;
                scattering(row / (STEPS + 1), half_sine) as f32
            })
            .collect();
        let sites = sites(500, target);
        let subset = Subset { first: 1, every: 3 };
        let found = |isa: Isa| {
            let mut scores = vec![[0.0; 2]; subset.count(sites.len())];
            isa.run(ExpectedScores {
                target,
                depths: &table,
                scattering: &scattering,
                sites: &sites,
                subset,
                scores: &mut scores,
            });
            scores
        };
        let scores = found(Isa::widest());
        assert_eq!(scores.len(), 167);
        for (number, found) in scores.iter().enumerate() {
            let expected = score(&sites[1 + 3 * number], &target);
            for (found, expected) in found.iter().zip(expected) {
                let error = f64::from(*found) / expected - 1.0;
                assert!(error.abs() < 1e-4, "site {number}: {found} {expected}");
            }
        }
        for isa in Isa::all() {
            assert_eq!(found(isa), scores, "{isa:?}");
        }
    }
}
