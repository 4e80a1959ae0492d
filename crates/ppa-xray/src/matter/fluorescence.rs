//! K fluorescence: the photons that follow the absorption of a photon by a K shell.

/// Kα₁, Kα₂, Kβ₁ (from M shells), Kβ₂ (from N shells and beyond).
const LINES: usize = 4;

/// K fluorescence of an element, from xraylib's tables.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct KFluorescence {
    /// Energy of the K edge in keV.
    pub(crate) edge_kev: f64,
    /// Share of the photoelectric absorption above the edge that the K shell does.
    k_share: f64,
    /// Photons per K vacancy.
    fluorescence_yield: f64,
    /// Energy in keV and share of each line.
    lines: [(f64, f64); LINES],
}

/// A photon that may follow photoelectric absorption.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FluorescenceLine {
    /// Its energy in keV.
    pub energy_kev: f64,
    /// Photons of this line per photoelectric absorption.
    pub probability: f64,
}

impl KFluorescence {
    /// From edge, yield, K share, and (energy, share) of the lines as they stand in the embedded table; all zero for none.
    pub(crate) fn from_table(numbers: &[f64]) -> Option<Self> {
        let (&[edge_kev, fluorescence_yield, k_share], lines) = numbers.split_first_chunk()?;
        (edge_kev > 0.0).then(|| Self {
            edge_kev,
            k_share,
            fluorescence_yield,
            lines: std::array::from_fn(|line| (lines[2 * line], lines[2 * line + 1])),
        })
    }

    /// The lines of photons absorbed above the edge in a material in which this element does the share `element_share` of
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

#[cfg(test)]
mod tests {
    use crate::matter::{cross_sections::elements, material::Material};

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
