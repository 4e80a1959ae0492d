//! K fluorescence: the photons emitted after the absorption of a photon by a K shell.

use crate::{
    matter::energy_range::{MAX_ENERGY_KEV, MIN_ENERGY_KEV},
    matter::material::Material,
    octaves::Octaves,
};

/// Kα₁, Kα₂, Kβ₁ (from M shells), Kβ₂ (from N shells and beyond).
const LINES: usize = 4;

/// K fluorescence of an element, from the tables of xraylib.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct KFluorescence {
    /// Energy of the K edge in keV.
    pub(crate) edge_kev: f64,
    /// Share of the K shell in the photoelectric absorption above the edge.
    k_share: f64,
    /// Photons per K vacancy.
    fluorescence_yield: f64,
    /// Energy in keV and share of each line.
    lines: [(f64, f64); LINES],
}

/// A photon that may follow photoelectric absorption.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FluorescenceLine {
    /// Energy in keV.
    pub energy_kev: f64,
    /// Photons of this line per photoelectric absorption.
    pub probability: f64,
}

impl KFluorescence {
    /// From edge, yield, K share, and (energy, share) of the lines in the embedded table; `None` if all are zero.
    pub(crate) fn from_table(numbers: &[f64]) -> Option<Self> {
        let (&[edge_kev, fluorescence_yield, k_share], lines) = numbers.split_first_chunk()?;
        (edge_kev > 0.0).then(|| Self {
            edge_kev,
            k_share,
            fluorescence_yield,
            lines: std::array::from_fn(|line| (lines[2 * line], lines[2 * line + 1])),
        })
    }

    /// The lines of photons absorbed above the edge in a material in which this element has the share `element_share` of
    /// the photoelectric absorption.
    pub(crate) fn lines(&self, element_share: f64) -> impl Iterator<Item = FluorescenceLine> {
        let per_absorption = element_share * self.k_share * self.fluorescence_yield;
        self.lines
            .into_iter()
            .map(move |(energy_kev, share)| FluorescenceLine {
                energy_kev,
                probability: per_absorption * share,
            })
            .filter(|line| line.probability > 0.0)
    }
}

/// Sampler of the K photons that follow photoelectric absorption in one material.
#[derive(Clone, Debug)]
pub(crate) struct Fluorescence {
    energies: Octaves,
    emitters: Vec<Emitter>,
    /// Largest emission probability of any absorption.
    most: f64,
}

/// An element with K lines above the cutoff.
#[derive(Clone, Debug)]
struct Emitter {
    edge_kev: f64,
    /// Energy in keV of each line, and its photons per absorption by this element.
    lines: Vec<(f64, f64)>,
    /// Share of the element in the photoelectric absorption, by energy.
    share: Vec<f32>,
}

/// Bins per octave of energy, as a power of two.
const ENERGY_BITS: u32 = 6;

impl Fluorescence {
    /// Prepares a sampler; lines below `cutoff_kev` count as absorbed.
    pub(crate) fn new(material: &Material, cutoff_kev: f64) -> Self {
        let energies = Octaves::covering(MIN_ENERGY_KEV, MAX_ENERGY_KEV, ENERGY_BITS);
        let emitters: Vec<Emitter> = material
            .k_emitters()
            .filter_map(|(z, k)| {
                let lines: Vec<(f64, f64)> = k
                    .lines(1.0)
                    .filter(|line| line.energy_kev >= cutoff_kev)
                    .map(|line| (line.energy_kev, line.probability))
                    .collect();
                let share = |energy: f64| {
                    material.photoelectric_share(z, energy.min(MAX_ENERGY_KEV)) as f32
                };
                (!lines.is_empty()).then(|| Emitter {
                    edge_kev: k.edge_kev,
                    lines,
                    share: energies.nodes().map(share).collect(),
                })
            })
            .collect();
        let most = emitters.iter().map(|Emitter { lines, share, .. }| {
            let share = share.iter().copied().fold(0.0, f32::max);
            f64::from(share) * lines.iter().map(|line| line.1).sum::<f64>()
        });
        Self {
            most: most.sum(),
            energies,
            emitters,
        }
    }

    /// Energy of the photon emitted after an absorption at `energy_kev`, if any; `u` is uniform in [0, 1).
    #[inline]
    pub(crate) fn sample(&self, energy_kev: f64, u: f64) -> Option<f64> {
        if u < self.most {
            self.line(energy_kev, u)
        } else {
            None
        }
    }

    fn line(&self, energy_kev: f64, mut u: f64) -> Option<f64> {
        for (line_kev, probability) in self.lines(energy_kev) {
            if u < probability {
                return Some(line_kev);
            }
            u -= probability;
        }
        None
    }

    /// Energies in keV of the photons that may be emitted after an absorption at `energy_kev`, with their probabilities.
    pub(crate) fn lines(&self, energy_kev: f64) -> impl Iterator<Item = (f64, f64)> {
        let emitters = self.emitters.iter();
        emitters
            .filter(move |emitter| energy_kev > emitter.edge_kev)
            .flat_map(move |emitter| {
                let (bin, fraction) = self.energies.locate(energy_kev);
                let [low, high] = [bin, bin + 1].map(|i| f64::from(emitter.share[i]));
                let share = low + fraction * (high - low);
                let lines = emitter.lines.iter();
                lines.map(move |&(line_kev, per_absorption)| (line_kev, share * per_absorption))
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::matter::compton::ComptonModel;
    use crate::matter::{cross_sections::elements, sampler::MaterialTables};

    /// Energies from the X-ray Data Booklet (LBNL/PUB-490, table 1-2), yields from Krause (J. Phys. Chem. Ref. Data 8, 307,
    /// 1979): Ca 0.163, I 0.884, W 0.958.
    #[test]
    fn lines_are_those_of_the_data_booklet() {
        for (z, alpha_kev, beta_kev, krause) in [
            (20, 3.692, 4.013, 0.163),
            (53, 28.612, 32.295, 0.884),
            (74, 59.318, 67.244, 0.958),
        ] {
            let k = elements().get(z).unwrap().k_fluorescence().unwrap();
            assert!((k.lines[0].0 - alpha_kev).abs() < 2e-3);
            assert!((k.lines[2].0 / beta_kev - 1.0).abs() < 3e-3);
            assert!((k.fluorescence_yield / krause - 1.0).abs() < 0.05);
            let shares: f64 = k.lines.iter().map(|line| line.1).sum();
            assert!((shares - 1.0).abs() < 1e-6);
        }
    }

    /// Photons per absorption and their mean energy, over a uniform grid of random numbers, against the sums over the lines.
    #[test]
    fn samples_follow_the_lines() {
        for (name, energy_kev) in [
            ("csi", 34.5),
            ("csi", 60.0),
            ("iodine", 80.0),
            ("gos", 100.0),
        ] {
            let material = Material::named(name).unwrap();
            let tables = MaterialTables::new(&material, ComptonModel::default());
            let n = 100_000;
            let emitted: Vec<f64> = (0..n)
                .filter_map(|i| {
                    tables.k_fluorescence(energy_kev, (f64::from(i) + 0.5) / f64::from(n))
                })
                .collect();
            let lines = material.k_fluorescence(energy_kev);
            let probability: f64 = lines.iter().map(|line| line.probability).sum();
            let energy: f64 = lines
                .iter()
                .map(|line| line.probability * line.energy_kev)
                .sum();
            // 3e-3 from the interpolation of the shares next to the edges of neighbours.
            assert!(
                (emitted.len() as f64 / f64::from(n) - probability).abs() < 3e-3,
                "{name}"
            );
            let sampled: f64 = emitted.iter().sum::<f64>() / f64::from(n);
            assert!(
                (sampled / energy - 1.0).abs() < 5e-3,
                "{name}: {sampled} {energy}"
            );
        }
        // Calcium and titanium emit below the cutoff of the transport, 5 keV.
        for name in ["bone_cortical", "titanium"] {
            let tables =
                MaterialTables::new(&Material::named(name).unwrap(), ComptonModel::default());
            let emitted = (0..10_000)
                .filter(|&i| {
                    tables
                        .k_fluorescence(30.0, f64::from(i) / 10_000.0)
                        .is_some()
                })
                .count();
            assert!(emitted <= 20, "{name}: {emitted}"); // traces of zinc
        }
    }

    /// The K share of the table is the jump of the embedded photoelectric cross sections; those of caesium and
    /// iodine together leave CsI the emission of Swank 1973 (doi:10.1063/1.1662918), about 0.7 per absorption.
    #[test]
    fn shares_follow_from_the_cross_sections() {
        for z in [20, 34, 53, 55, 64, 74, 82] {
            let element = elements().get(z).unwrap();
            let k = element.k_fluorescence().unwrap();
            let [below, above] =
                [0.995, 1.005].map(|f| element.cross_sections(f * k.edge_kev).photoelectric);
            let jump = 1.0 - below / above;
            assert!(
                (k.k_share - jump).abs() < 0.03,
                "Z = {z}: {} {jump}",
                k.k_share
            );
        }
        let csi = Material::named("csi").unwrap();
        let emitted = |energy_kev| -> f64 {
            csi.k_fluorescence(energy_kev)
                .iter()
                .map(|line| line.probability)
                .sum()
        };
        assert_eq!(emitted(33.0), 0.0);
        assert!((0.5..0.7).contains(&emitted(34.5)), "{}", emitted(34.5));
        assert!((0.68..0.78).contains(&emitted(60.0)), "{}", emitted(60.0));
    }
}
