//! The attenuation of all materials as mixtures of a few of them.
//!
//! Bone between spongy and compact is a mixture of soft tissue and cortical bone, and so is its attenuation; the attenuation of every
//! tissue is nearly a combination of the same two or three smooth functions of energy (Alvarez and Macovski, Phys. Med. Biol. 21 (1976)
//! 733). A ray therefore needs to accumulate the masses of only four materials instead of 27.
//! docs/physics.md, "Fast engine", primary.

use crate::matter::energy_range::{CUTOFF_KEV, MAX_ENERGY_KEV};
use crate::transport::attenuation::Attenuation;
use crate::vector_math::{WIDTH, pad};

/// Number of basis materials per group, one SIMD register.
pub(crate) const LANES: usize = 4;

/// Nodes per keV of the table of the basis.
const NODES_PER_KEV: usize = 8;

/// Largest weighted relative error of a material's attenuation at any energy. Rounding of the tables is about 1e-6.
const TOLERANCE: f64 = 1e-4;

/// Energy above which relative errors have full weight, keV.
const FULL_WEIGHT_KEV: f64 = 20.0;

/// Represents every material as a sum of basis materials.
#[derive(Debug)]
pub(crate) struct AttenuationBasis {
    /// Number of groups of [`LANES`] basis materials.
    pub groups: usize,
    /// Grams of each basis material per gram of a material; material by material.
    shares: Vec<[f32; LANES]>,
    /// Attenuation of the basis materials, mm⁻¹ per g/cm³; node by node.
    table: Vec<[f32; LANES]>,
}

impl AttenuationBasis {
    /// Builds the basis of `materials` materials.
    ///
    /// Adds the material with the worst representation to the basis until all are represented.
    pub fn new(attenuation: &Attenuation, materials: usize) -> Self {
        let nodes = ((MAX_ENERGY_KEV - CUTOFF_KEV) * NODES_PER_KEV as f64).ceil() as usize + 1;
        let energy = |node: usize| CUTOFF_KEV + node as f64 / NODES_PER_KEV as f64;
        let total = |material: usize, node: usize| {
            let at = attenuation.locate(energy(node).min(MAX_ENERGY_KEV));
            f64::from(attenuation.at(material as u8, at).total)
        };
        let curves: Vec<Vec<f64>> = (0..materials)
            .map(|material| (0..nodes).map(|node| total(material, node)).collect())
            .collect();
        let weights: Vec<f64> = (0..nodes).map(|node| weight(energy(node))).collect();
        let (members, shares) = represent(&curves, &weights);
        let groups = members.len().div_ceil(LANES);
        let padded = |values: &[f64]| -> Vec<[f32; LANES]> {
            (0..groups)
                .map(|group| {
                    std::array::from_fn(|lane| {
                        values.get(group * LANES + lane).map_or(0.0, |&v| v as f32)
                    })
                })
                .collect()
        };
        Self {
            groups,
            shares: shares.iter().flat_map(|row| padded(row)).collect(),
            table: (0..nodes)
                .flat_map(|node| {
                    let row: Vec<f64> = members.iter().map(|&m| curves[m][node]).collect();
                    padded(&row)
                })
                .collect(),
        }
    }

    /// Shares of the basis materials in a gram of `material`.
    #[inline]
    pub fn shares(&self, material: u8) -> &[[f32; LANES]] {
        let first = usize::from(material) * self.groups;
        &self.shares[first..first + self.groups]
    }

    /// Attenuation of the basis materials at an energy, mm⁻¹ per g/cm³.
    pub fn at(&self, energy_kev: f64) -> Vec<[f32; LANES]> {
        (0..self.groups)
            .map(|group| {
                std::array::from_fn(|lane| {
                    let mut mass = vec![[0.0; LANES]; self.groups];
                    mass[group][lane] = 1.0;
                    self.exponent(&mass, energy_kev)
                })
            })
            .collect()
    }

    /// Attenuation of every basis material, mm⁻¹ per g/cm³, energy by energy, padded with zeros to a multiple of [`WIDTH`].
    pub fn by_line(&self, energies_kev: &[f64]) -> Vec<Vec<f32>> {
        let mut by_line = vec![Vec::new(); self.groups * LANES];
        for &energy_kev in energies_kev {
            let at = self.at(energy_kev);
            for (material, mu) in by_line.iter_mut().zip(at.as_flattened()) {
                material.push(*mu);
            }
        }
        for material in &mut by_line {
            pad(material);
        }
        by_line
    }

    /// Attenuation exponent of basis masses, mm g/cm³, at an energy within the table.
    #[inline]
    pub fn exponent(&self, mass: &[[f32; LANES]], energy_kev: f64) -> f32 {
        let at = (energy_kev - CUTOFF_KEV) * NODES_PER_KEV as f64;
        let node = (at.max(0.0) as usize).min(self.table.len() / self.groups - 2);
        let fraction = (at - node as f64) as f32;
        let low = &self.table[node * self.groups..][..self.groups];
        let high = &self.table[(node + 1) * self.groups..][..self.groups];
        let mut sum = [0.0_f32; LANES];
        for ((mass, low), high) in mass.iter().zip(low).zip(high) {
            for lane in 0..LANES {
                sum[lane] += mass[lane] * (low[lane] + fraction * (high[lane] - low[lane]));
            }
        }
        (sum[0] + sum[1]) + (sum[2] + sum[3])
    }
}

/// Attenuation exponent of basis masses under attenuations of the basis materials.
#[inline(always)]
pub(crate) fn dot(mass: &[[f32; LANES]], attenuation: &[[f32; LANES]]) -> f32 {
    mass.iter()
        .zip(attenuation)
        .map(|(m, mu)| (m[0] * mu[0] + m[1] * mu[1]) + (m[2] * mu[2] + m[3] * mu[3]))
        .sum()
}

/// Attenuation exponents of basis masses at [`WIDTH`] lines from `first` on; `by_line` is [`AttenuationBasis::by_line`].
#[inline(always)]
pub(crate) fn exponents(mass: &BasisMass, by_line: &[Vec<f32>], first: usize) -> [f32; WIDTH] {
    let mut exponents = [0.0; WIDTH];
    for (mass, mu) in mass.as_flattened().iter().zip(by_line) {
        for (sum, mu) in exponents.iter_mut().zip(&mu[first..first + WIDTH]) {
            *sum += mass * mu;
        }
    }
    exponents
}

/// Weight of a relative error at an energy; it is small where strong attenuation lets few photons through.
fn weight(energy_kev: f64) -> f64 {
    (energy_kev / FULL_WEIGHT_KEV).powi(3).min(1.0)
}

/// Members of the basis, and every curve as a sum of them.
///
/// Gram–Schmidt that adds the worst curve next; errors are relative, with the `weights` of the nodes.
fn represent(curves: &[Vec<f64>], weights: &[f64]) -> (Vec<usize>, Vec<Vec<f64>>) {
    let mut members = Vec::new();
    loop {
        let shares: Vec<Vec<f64>> = curves
            .iter()
            .enumerate()
            .map(|(index, curve)| {
                members
                    .iter()
                    .position(|&member| member == index)
                    .map_or_else(
                        || fit(curves, &members, curve, weights),
                        |place| unit(place, members.len()),
                    )
            })
            .collect();
        let error = |index: usize| -> f64 {
            let curve = &curves[index];
            (0..curve.len())
                .map(|node| {
                    let sum: f64 = members
                        .iter()
                        .zip(&shares[index])
                        .map(|(&member, share): (&usize, _)| share * curves[member][node])
                        .sum();
                    (sum / curve[node] - 1.0).abs() * weights[node]
                })
                .fold(0.0, f64::max)
        };
        let worst = (0..curves.len())
            .filter(|index| !members.contains(index))
            .map(|index| (index, error(index)))
            .max_by(|a, b| a.1.total_cmp(&b.1));
        match worst {
            Some((index, error)) if error > TOLERANCE => members.push(index),
            _ => return (members, shares),
        }
    }
}

fn unit(place: usize, length: usize) -> Vec<f64> {
    (0..length)
        .map(|i| if i == place { 1.0 } else { 0.0 })
        .collect()
}

/// Weighted least squares of relative errors.
fn fit(curves: &[Vec<f64>], members: &[usize], curve: &[f64], weights: &[f64]) -> Vec<f64> {
    if members.is_empty() {
        return Vec::new();
    }
    let rows = curve.len();
    let matrix = nalgebra::DMatrix::from_fn(rows, members.len(), |node, member| {
        weights[node] * curves[members[member]][node] / curve[node]
    });
    let target = nalgebra::DVector::from_column_slice(weights);
    matrix
        .svd(true, true)
        .solve(&target, 1e-14)
        .expect("both factors were computed")
        .iter()
        .copied()
        .collect()
}

/// Masses of the basis materials along a path, mm g/cm³, in groups of [`LANES`].
pub(crate) type BasisMass = [[f32; LANES]];

/// Adds `amount` of a mixture of basis materials.
#[inline(always)]
pub(super) fn add(mass: &mut BasisMass, shares: &BasisMass, amount: f32) {
    // One group is the common case and needs no loop.
    if let ([mass], [share]) = (&mut *mass, shares) {
        for lane in 0..LANES {
            mass[lane] += share[lane] * amount;
        }
        return;
    }
    for (mass, share) in mass.iter_mut().zip(shares) {
        for lane in 0..LANES {
            mass[lane] += share[lane] * amount;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::matter::compton::ComptonModel;
    use crate::matter::material::Material;
    use crate::matter::sampler::MaterialTables;

    /// Mixtures need no basis materials of their own, and every exponent agrees with that of the masses themselves.
    #[test]
    fn a_few_materials_stand_for_all_their_mixtures() {
        let named = |name: &str| Material::named(name).unwrap();
        let mut materials: Vec<Material> = ["air", "soft_tissue", "bone_cortical", "titanium"]
            .map(named)
            .to_vec();
        for share in [0.1, 0.35, 0.8] {
            let parts = [(&materials[1], 1.0 - share), (&materials[2], share)];
            materials.push(Material::mixture("mixture", 1.4, &parts).unwrap());
        }
        materials.push(named("lead"));
        materials.push(named("water"));
        let tables: Vec<_> = materials
            .iter()
            .map(|material| MaterialTables::new(material, ComptonModel::default()))
            .collect();
        let attenuation = Attenuation::new(&tables);
        let basis = AttenuationBasis::new(&attenuation, materials.len());
        assert!(basis.groups <= 2, "{} groups", basis.groups);
        let masses: Vec<f32> = (0..materials.len()).map(|m| 3.0 + m as f32).collect();
        for energy_kev in [5.0, 17.3, 60.0, 119.9] {
            for (material, &mass) in masses.iter().enumerate() {
                let projected: Vec<[f32; LANES]> = basis
                    .shares(material as u8)
                    .iter()
                    .map(|share| share.map(|share| share * mass))
                    .collect();
                let node = attenuation.locate(energy_kev);
                let exact = mass * attenuation.at(material as u8, node).total;
                let found = basis.exponent(&projected, energy_kev);
                // Lead has edges between the nodes of the basis.
                let tolerance = if material == 7 { 2e-3 } else { 3e-4 };
                assert!(
                    (found / exact - 1.0).abs() < tolerance,
                    "material {material} at {energy_kev} keV: {found} {exact}"
                );
                let dotted = dot(&projected, &basis.at(energy_kev));
                assert!((dotted / found - 1.0).abs() < 1e-4);
            }
        }
    }
}
