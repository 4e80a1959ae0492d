//! Elements by mass fraction, and their cross sections per gram.

use crate::matter::cross_sections::{CrossSections, Element, elements};
use crate::matter::electron_shell::Shell;
use crate::matter::element::{atomic_number, symbol};
use crate::matter::fluorescence::KFluorescence;
use crate::matter::material_error::MaterialError;

/// Atomic numbers within the embedded data and positive mass fractions, ascending in Z; the fractions add up to 1.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Composition(Vec<(u8, f64)>);

impl Composition {
    /// Checks, sorts and normalises mass fractions; `name` is that of the material, for errors.
    pub fn new(name: &str, mass_fractions: &[(u8, f64)]) -> Result<Self, MaterialError> {
        let name = || name.to_owned();
        let mut sorted = Vec::with_capacity(mass_fractions.len());
        for &(z, found) in mass_fractions {
            let Some(symbol) = symbol(z) else {
                return Err(MaterialError::AtomicNumber { name: name(), z });
            };
            if !(found.is_finite() && found >= 0.0) {
                return Err(MaterialError::Fraction {
                    name: name(),
                    symbol,
                    found,
                });
            }
            if sorted.iter().any(|&(other, _)| other == z) {
                return Err(MaterialError::Duplicate {
                    name: name(),
                    symbol,
                });
            }
            if found > 0.0 {
                sorted.push((z, found));
            }
        }
        if sorted.is_empty() {
            return Err(MaterialError::Empty { name: name() });
        }
        sorted.sort_by_key(|&(z, _)| z);
        let sum: f64 = sorted.iter().map(|&(_, w)| w).sum();
        if (sum - 1.0).abs() > 0.01 {
            return Err(MaterialError::Sum {
                name: name(),
                found: sum,
            });
        }
        for (_, fraction) in &mut sorted {
            *fraction /= sum;
        }
        Ok(Self(sorted))
    }

    /// Parses text such as `Ca:0.4,O:0.6`: symbols and mass fractions.
    pub fn parse(name: &str, text: &str) -> Result<Self, MaterialError> {
        let mass_fractions = text
            .split(',')
            .map(|part| {
                let syntax = || MaterialError::Syntax {
                    found: part.trim().to_owned(),
                };
                let (symbol, fraction) = part.split_once(':').ok_or_else(syntax)?;
                let z = atomic_number(symbol.trim()).ok_or_else(syntax)?;
                Ok((z, fraction.trim().parse().map_err(|_| syntax())?))
            })
            .collect::<Result<Vec<_>, _>>()?;
        Self::new(name, &mass_fractions)
    }

    /// The text that [`Composition::parse`] reads.
    pub fn text(&self) -> String {
        let parts = self.0.iter().map(|&(z, fraction)| {
            let symbol = symbol(z).expect("Z checked on the way in");
            format!("{symbol}:{}", (fraction * 1e7).round() / 1e7)
        });
        parts.collect::<Vec<_>>().join(",")
    }

    pub fn mass_fractions(&self) -> &[(u8, f64)] {
        &self.0
    }

    fn elements(&self) -> impl Iterator<Item = (&'static Element, f64)> {
        self.0.iter().map(|&(z, fraction)| {
            (
                elements().get(z).expect("Z checked on the way in"),
                fraction,
            )
        })
    }

    pub fn cross_sections(&self, energy_kev: f64) -> CrossSections {
        self.elements()
            .fold(CrossSections::default(), |sum, (element, w)| {
                sum + element.cross_sections(energy_kev).scaled(w)
            })
    }

    /// Returns [`Composition::cross_sections`] at [`energy_nodes`](crate::matter::energy_nodes::energy_nodes).
    pub fn cross_sections_at_nodes(&self) -> Vec<CrossSections> {
        let mut sums = Vec::new();
        for (element, w) in self.elements() {
            let sections = element.cross_sections_at_nodes();
            sums.resize(sections.len(), CrossSections::default());
            for (sum, sections) in sums.iter_mut().zip(sections) {
                *sum = *sum + sections.scaled(w);
            }
        }
        sums
    }

    /// Σ w/A · S(q).
    pub fn incoherent(&self, q: f64) -> f64 {
        self.elements()
            .map(|(element, w)| w / element.atomic_weight * element.incoherent(q))
            .sum()
    }

    /// Σ w/A · F²(q), independent atoms.
    pub fn form_factor_squared(&self, q: f64) -> f64 {
        self.elements()
            .map(|(element, w)| w / element.atomic_weight * element.form_factor(q).powi(2))
            .sum()
    }

    /// Electron shells, with electrons per unit mass up to a constant.
    pub fn shells(&self) -> Vec<Shell> {
        self.elements()
            .flat_map(|(element, w)| {
                element.shells().iter().map(move |shell| Shell {
                    electrons: shell.electrons * w / element.atomic_weight,
                    ..*shell
                })
            })
            .collect()
    }

    /// Elements with K fluorescence inside the tables, by atomic number.
    pub fn k_emitters(&self) -> impl Iterator<Item = (u8, &'static KFluorescence)> {
        self.0
            .iter()
            .zip(self.elements())
            .filter_map(|(&(z, _), (element, _))| Some((z, element.k_fluorescence()?)))
    }

    /// Share of an element in the photoelectric absorption.
    pub fn photoelectric_share(&self, z: u8, energy_kev: f64) -> f64 {
        let part: f64 = self
            .0
            .iter()
            .zip(self.elements())
            .filter(|((other, _), _)| *other == z)
            .map(|(_, (element, w))| w * element.cross_sections(energy_kev).photoelectric)
            .sum();
        part / self.cross_sections(energy_kev).photoelectric
    }

    /// Absorption edges in keV.
    pub fn edges_kev(&self) -> impl Iterator<Item = f64> {
        self.elements().flat_map(|(element, _)| element.edges_kev())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::matter::cross_sections::HC_KEV_ANGSTROM;
    use crate::matter::material::Material;

    proptest::proptest! {
        /// Every element at every energy: finite, positive, F(0) = Z, S from 0 to at most Z.
        #[test]
        fn every_element_has_sound_tables(z in 1..=92_u8, energy_kev in 1.0..=150.0_f64) {
            let element = elements().get(z).unwrap();
            let sections = element.cross_sections(energy_kev);
            for value in [sections.photoelectric, sections.rayleigh, sections.compton] {
                proptest::prop_assert!(value.is_finite() && value > 0.0);
            }
            let q = energy_kev / HC_KEV_ANGSTROM;
            proptest::prop_assert!((element.form_factor(0.0) / f64::from(z) - 1.0).abs() < 1e-6);
            proptest::prop_assert!(element.form_factor(q) < f64::from(z) && element.form_factor(q) > 0.0);
            proptest::prop_assert!(element.incoherent(0.0) == 0.0 && element.incoherent(q) > 0.0);
            proptest::prop_assert!(element.incoherent(q) < f64::from(z) * 1.001);
        }
    }

    #[test]
    fn compositions_that_make_no_sense_are_refused() {
        let made = |density, fractions: &[(u8, f64)]| {
            Material::from_composition("x", density, fractions).unwrap_err()
        };
        assert!(matches!(
            made(f64::NAN, &[(1, 1.0)]),
            MaterialError::Density { .. }
        ));
        assert!(matches!(made(1.0, &[]), MaterialError::Empty { .. }));
        assert!(matches!(
            made(1.0, &[(0, 1.0)]),
            MaterialError::AtomicNumber { z: 0, .. }
        ));
        assert!(matches!(
            made(1.0, &[(93, 1.0)]),
            MaterialError::AtomicNumber { z: 93, .. }
        ));
        assert!(matches!(
            made(1.0, &[(1, 0.5), (1, 0.5)]),
            MaterialError::Duplicate { .. }
        ));
        assert!(matches!(
            made(1.0, &[(1, 1.5), (8, -0.5)]),
            MaterialError::Fraction { .. }
        ));
        assert!(matches!(
            made(1.0, &[(1, 0.5), (8, 0.4)]),
            MaterialError::Sum { .. }
        ));
        assert!(matches!(
            Material::parse_composition("x", 1.0, "Ca 0.4"),
            Err(MaterialError::Syntax { .. })
        ));
        assert!(matches!(
            Material::named("unobtainium"),
            Err(MaterialError::Unknown { .. })
        ));
        let water = Material::named("water").unwrap();
        for found_kev in [0.99, 150.01, f64::NAN] {
            assert!(matches!(
                water.total_cm2_g(found_kev),
                Err(MaterialError::Energy { .. })
            ));
        }
        let again = Material::parse_composition("water", 1.0, &water.composition()).unwrap();
        assert!((again.mass_fractions()[1].1 - water.mass_fractions()[1].1).abs() < 1e-7);
        let parsed = Material::parse_composition("water", 1.0, "H:0.112, O:0.889").unwrap();
        assert!((parsed.mass_fractions()[0].1 - 0.112 / 1.001).abs() < 1e-15);
    }
}
