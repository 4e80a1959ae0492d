//! Attenuation per material and energy.

use rayon::prelude::*;

use crate::matter::energy_range::{CUTOFF_KEV, MAX_ENERGY_KEV};
use crate::matter::sampler::MaterialTables;

/// 2⁹ nodes per octave of energy: the error of linear interpolation of E⁻³ is below 6e-6.
const OCTAVE_BITS: u32 = 9;

/// Energies are distinguished by the leading bits of their `f32`.
const SHIFT: u32 = f32::MANTISSA_DIGITS - 1 - OCTAVE_BITS;

const FIRST_KEY: u32 = (CUTOFF_KEV as f32).to_bits() >> SHIFT;

/// Number of nodes; the last is at or above [`MAX_ENERGY_KEV`].
pub(crate) const NODES: usize =
    (((MAX_ENERGY_KEV as f32).to_bits() >> SHIFT) + 2 - FIRST_KEY) as usize;

/// Cumulative sums of the interaction coefficients, mm⁻¹ per g/cm³.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Coefficients {
    pub photoelectric: f32,
    pub with_compton: f32,
    /// Sum of photoelectric, Compton and Rayleigh.
    pub total: f32,
}

/// Position of an energy between two nodes.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct EnergyNode {
    pub node: u32,
    fraction: f32,
}

/// Coefficients of all materials from [`CUTOFF_KEV`] to [`MAX_ENERGY_KEV`].
#[derive(Debug)]
pub(crate) struct Attenuation {
    /// By material and node: photoelectric, photoelectric plus Compton, total, and padding to 16 bytes per node.
    table: Vec<[f32; 4]>,
}

impl Attenuation {
    pub fn new(materials: &[MaterialTables]) -> Self {
        let rows: Vec<Vec<[f32; 4]>> = materials
            .par_iter()
            .map(|material| {
                (0..NODES as u32)
                    .map(|node| {
                        let cm2_g = material.cross_sections(f64::from(node_kev(node)));
                        let photoelectric = cm2_g.photoelectric / 10.0; // cm²/g → 1/mm per g/cm³
                        let with_compton = photoelectric + cm2_g.compton / 10.0;
                        let total = with_compton + cm2_g.rayleigh / 10.0;
                        [photoelectric as f32, with_compton as f32, total as f32, 0.0]
                    })
                    .collect()
            })
            .collect();
        Self {
            table: rows.concat(),
        }
    }

    /// Position of `energy_kev`; energies beyond the table go to its ends.
    #[inline]
    pub fn locate(&self, energy_kev: f64) -> EnergyNode {
        let bits = (energy_kev as f32).to_bits();
        let node = (bits >> SHIFT)
            .saturating_sub(FIRST_KEY)
            .min(NODES as u32 - 2);
        EnergyNode {
            node,
            fraction: (bits & ((1 << SHIFT) - 1)) as i32 as f32 * (1.0 / (1 << SHIFT) as f32),
        }
    }

    #[inline]
    pub fn at(&self, material: u8, energy: EnergyNode) -> Coefficients {
        let first = usize::from(material) * NODES + energy.node as usize;
        let [low, high] = &self.table[first..first + 2] else {
            unreachable!("two nodes")
        };
        let mix: [f32; 4] =
            std::array::from_fn(|sum| low[sum] + energy.fraction * (high[sum] - low[sum]));
        Coefficients {
            photoelectric: mix[0],
            with_compton: mix[1],
            total: mix[2],
        }
    }

    pub fn materials(&self) -> usize {
        self.table.len() / NODES
    }

    /// Largest total coefficient of a material from one node to another.
    pub fn largest(&self, material: usize, nodes: std::ops::RangeInclusive<usize>) -> f32 {
        let first = material * NODES;
        self.table[first + nodes.start()..=first + *nodes.end()]
            .iter()
            .map(|sums| sums[2])
            .fold(0.0, f32::max)
    }
}

/// Energy of a node, keV.
fn node_kev(node: u32) -> f32 {
    f32::from_bits((FIRST_KEY + node) << SHIFT)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::matter::compton::ComptonModel;
    use crate::matter::material::Material;

    /// Interpolation follows the cross sections it was made from, except at edges (water has none above 5 keV).
    #[test]
    fn coefficients_are_those_of_the_material() {
        let tables = [MaterialTables::new(
            &Material::named("water").unwrap(),
            ComptonModel::default(),
        )];
        let attenuation = Attenuation::new(&tables);
        let mut energy_kev = CUTOFF_KEV;
        while energy_kev <= MAX_ENERGY_KEV {
            let expected = tables[0].cross_sections(energy_kev);
            let found = attenuation.at(0, attenuation.locate(energy_kev));
            for (found, expected) in [
                (found.photoelectric, expected.photoelectric),
                (
                    found.total,
                    expected.photoelectric + expected.compton + expected.rayleigh,
                ),
            ] {
                let ratio = f64::from(found) * 10.0 / expected;
                assert!((ratio - 1.0).abs() < 1e-4, "{energy_kev} keV: {ratio}");
            }
            energy_kev += 0.0371;
        }
    }
}
