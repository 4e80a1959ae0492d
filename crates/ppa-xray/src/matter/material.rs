//! Materials: elements by weight, and what a gram of them does to a photon.

use crate::{
    matter::compton::energy_ratio,
    matter::cross_sections::{
        CrossSections, ELECTRON_REST_KEV, HC_KEV_ANGSTROM, MAX_ENERGY_KEV, MIN_ENERGY_KEV, elements,
    },
    matter::element::{atomic_number, symbol},
    matter::library,
    matter::material_error::MaterialError,
};

/// A homogeneous material: elements by mass fraction and a nominal density.
///
/// ```
/// use ppa_xray::Material;
/// let water = Material::named("water")?;
/// assert!((water.total_cm2_g(60.0)? / 0.2059 - 1.0).abs() < 0.01); // NIST XCOM
/// let apatite = Material::parse_composition("apatite", 3.16, "Ca:0.3989,P:0.1850,O:0.4141,H:0.0020")?;
/// assert!(apatite.photoelectric_cm2_g(30.0)? > water.photoelectric_cm2_g(30.0)?);
/// # Ok::<(), ppa_xray::MaterialError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    name: String,
    density_g_cm3: f64,
    mass_fractions: Vec<(u8, f64)>,
}

impl Material {
    /// Material from (atomic number, mass fraction) pairs, Z = 1 to 92.
    ///
    /// Fractions that add up to 1 within 1 % are normalised; zero fractions are dropped.
    ///
    /// # Errors
    /// A density that is not positive; no element, a repeated one, or one outside the tables; fractions
    /// that are negative, not finite, or do not add up to 1 within 1 %.
    pub fn from_composition(
        name: impl Into<String>,
        density_g_cm3: f64,
        mass_fractions: &[(u8, f64)],
    ) -> Result<Self, MaterialError> {
        let name = name.into();
        if !(density_g_cm3.is_finite() && density_g_cm3 > 0.0) {
            return Err(MaterialError::Density {
                name,
                found: density_g_cm3,
            });
        }
        let mut sorted = Vec::with_capacity(mass_fractions.len());
        for &(z, found) in mass_fractions {
            let Some(symbol) = symbol(z) else {
                return Err(MaterialError::AtomicNumber { name, z });
            };
            if !(found.is_finite() && found >= 0.0) {
                return Err(MaterialError::Fraction {
                    name,
                    symbol,
                    found,
                });
            }
            if sorted.iter().any(|&(other, _)| other == z) {
                return Err(MaterialError::Duplicate { name, symbol });
            }
            if found > 0.0 {
                sorted.push((z, found));
            }
        }
        if sorted.is_empty() {
            return Err(MaterialError::Empty { name });
        }
        sorted.sort_by_key(|&(z, _)| z);
        let sum: f64 = sorted.iter().map(|&(_, w)| w).sum();
        if (sum - 1.0).abs() > 0.01 {
            return Err(MaterialError::Sum { name, found: sum });
        }
        for (_, fraction) in &mut sorted {
            *fraction /= sum;
        }
        Ok(Self {
            name,
            density_g_cm3,
            mass_fractions: sorted,
        })
    }

    /// Material from text such as `Ca:0.4,O:0.6`: symbols and mass fractions.
    ///
    /// # Errors
    /// Text of another form, and everything [`Material::from_composition`] refuses.
    pub fn parse_composition(
        name: impl Into<String>,
        density_g_cm3: f64,
        composition: &str,
    ) -> Result<Self, MaterialError> {
        let mass_fractions = composition
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
        Self::from_composition(name, density_g_cm3, &mass_fractions)
    }

    /// Materials mixed by mass fraction.
    ///
    /// # Errors
    /// Everything [`Material::from_composition`] refuses.
    pub fn mixture(
        name: impl Into<String>,
        density_g_cm3: f64,
        parts: &[(&Self, f64)],
    ) -> Result<Self, MaterialError> {
        let mut mass = std::collections::BTreeMap::<u8, f64>::new();
        for (part, share) in parts {
            for (z, fraction) in part.mass_fractions() {
                *mass.entry(*z).or_default() += share * fraction;
            }
        }
        let mass: Vec<_> = mass.into_iter().collect();
        Self::from_composition(name, density_g_cm3, &mass)
    }

    /// Material of the library, such as `water`, `bone_cortical` or `titanium`, or a pure element by symbol, such as `Al`.
    ///
    /// # Errors
    /// A name that [`Material::names`] does not list and that is no symbol.
    pub fn named(name: &str) -> Result<Self, MaterialError> {
        library::find(name).ok_or_else(|| MaterialError::Unknown {
            name: name.to_owned(),
            known: Self::names().collect(),
        })
    }

    /// Names of the library's materials.
    pub fn names() -> impl Iterator<Item = &'static str> {
        library::names()
    }

    /// Name.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Nominal density in g/cm³; transport takes the density of the voxel instead.
    #[must_use]
    pub fn density_g_cm3(&self) -> f64 {
        self.density_g_cm3
    }

    /// Atomic numbers and mass fractions, ascending in Z; the fractions add up to 1.
    #[must_use]
    pub fn mass_fractions(&self) -> &[(u8, f64)] {
        &self.mass_fractions
    }

    /// Mass attenuation by interaction at 1 to 150 keV.
    ///
    /// # Errors
    /// An energy outside the tables.
    pub fn cross_sections(&self, energy_kev: f64) -> Result<CrossSections, MaterialError> {
        if !(MIN_ENERGY_KEV..=MAX_ENERGY_KEV).contains(&energy_kev) {
            return Err(MaterialError::Energy {
                found_kev: energy_kev,
            });
        }
        Ok(self.cross_sections_unchecked(energy_kev))
    }

    pub(crate) fn cross_sections_unchecked(&self, energy_kev: f64) -> CrossSections {
        self.elements()
            .fold(CrossSections::default(), |sum, (element, fraction)| {
                sum + element.cross_sections(energy_kev).scaled(fraction)
            })
    }

    /// Photoelectric absorption in cm²/g.
    ///
    /// # Errors
    /// An energy outside 1 to 150 keV.
    pub fn photoelectric_cm2_g(&self, energy_kev: f64) -> Result<f64, MaterialError> {
        Ok(self.cross_sections(energy_kev)?.photoelectric)
    }

    /// Rayleigh scattering in cm²/g.
    ///
    /// # Errors
    /// An energy outside 1 to 150 keV.
    pub fn rayleigh_cm2_g(&self, energy_kev: f64) -> Result<f64, MaterialError> {
        Ok(self.cross_sections(energy_kev)?.rayleigh)
    }

    /// Compton scattering in cm²/g.
    ///
    /// # Errors
    /// An energy outside 1 to 150 keV.
    pub fn compton_cm2_g(&self, energy_kev: f64) -> Result<f64, MaterialError> {
        Ok(self.cross_sections(energy_kev)?.compton)
    }

    /// All interactions together in cm²/g.
    ///
    /// # Errors
    /// An energy outside 1 to 150 keV.
    pub fn total_cm2_g(&self, energy_kev: f64) -> Result<f64, MaterialError> {
        Ok(self.cross_sections(energy_kev)?.total())
    }

    /// Mass energy-transfer coefficient in cm²/g: what a photon field gives to electrons.
    ///
    /// Photoelectric part plus the Compton part times the mean fraction of energy that its electron gets
    /// (Klein–Nishina × S(q)). Fluorescence counts as absorbed: right for air and tissue, too high for metals just above their edges.
    ///
    /// # Errors
    /// An energy outside 1 to 150 keV.
    pub fn energy_transfer_cm2_g(&self, energy_kev: f64) -> Result<f64, MaterialError> {
        let sections = self.cross_sections(energy_kev)?;
        Ok(sections.photoelectric + sections.compton * self.compton_transfer_fraction(energy_kev))
    }

    /// Mean of (E − E′)/E over Klein–Nishina × S(q), by Simpson's rule in sin(θ/2), in which S is smooth.
    fn compton_transfer_fraction(&self, energy_kev: f64) -> f64 {
        const INTERVALS: usize = 64;
        let alpha = energy_kev / ELECTRON_REST_KEV;
        let (mut all, mut transferred) = (0.0, 0.0);
        for i in 0..=INTERVALS {
            let simpson = match i {
                0 | INTERVALS => 1.0,
                _ if i % 2 == 1 => 4.0,
                _ => 2.0,
            };
            let s = i as f64 / INTERVALS as f64;
            let cos = 1.0 - 2.0 * s * s;
            let ratio = energy_ratio(alpha, cos);
            let klein_nishina = ratio * ratio * (ratio + 1.0 / ratio - 1.0 + cos * cos);
            let weight = simpson
                * s
                * klein_nishina
                * self.incoherent_per_gram(s * energy_kev / HC_KEV_ANGSTROM);
            all += weight;
            transferred += weight * (1.0 - ratio);
        }
        transferred / all
    }

    /// Σ w/A · S(q): scattering electrons per unit mass, up to a constant.
    pub(crate) fn incoherent_per_gram(&self, q: f64) -> f64 {
        self.elements()
            .map(|(element, fraction)| fraction / element.atomic_weight * element.incoherent(q))
            .sum()
    }

    /// Σ w/A · F²(q), independent atoms.
    pub(crate) fn form_factor_squared_per_gram(&self, q: f64) -> f64 {
        self.elements()
            .map(|(element, fraction)| {
                fraction / element.atomic_weight * element.form_factor(q).powi(2)
            })
            .sum()
    }

    /// Absorption edges of all elements in keV.
    pub(crate) fn edges_kev(&self) -> impl Iterator<Item = f64> {
        self.elements().flat_map(|(element, _)| element.edges_kev())
    }

    fn elements(
        &self,
    ) -> impl Iterator<Item = (&'static crate::matter::cross_sections::Element, f64)> {
        self.mass_fractions.iter().map(|&(z, fraction)| {
            (
                elements().get(z).expect("Z checked on the way in"),
                fraction,
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// A mixture attenuates as its elements do, by weight.
        #[test]
        fn mixtures_follow_the_weights(z1 in 1..=46_u8, z2 in 47..=92_u8, share in 0.0..1.0_f64, energy_kev in 1.0..150.0_f64) {
            let alone = |z| Material::from_composition("element", 1.0, &[(z, 1.0)]).unwrap().total_cm2_g(energy_kev).unwrap();
            let mixture = Material::from_composition("mixture", 1.0, &[(z2, 1.0 - share), (z1, share)]).unwrap();
            let expected = share * alone(z1) + (1.0 - share) * alone(z2);
            prop_assert!((mixture.total_cm2_g(energy_kev).unwrap() / expected - 1.0).abs() < 1e-12);
        }

        /// Every element at every energy: finite, positive, F(0) = Z, S from 0 to no more than Z.
        #[test]
        fn every_element_has_sound_tables(z in 1..=92_u8, energy_kev in 1.0..=150.0_f64) {
            let element = elements().get(z).unwrap();
            let sections = element.cross_sections(energy_kev);
            for value in [sections.photoelectric, sections.rayleigh, sections.compton] {
                prop_assert!(value.is_finite() && value > 0.0);
            }
            let q = energy_kev / HC_KEV_ANGSTROM;
            prop_assert!((element.form_factor(0.0) / f64::from(z) - 1.0).abs() < 1e-6);
            prop_assert!(element.form_factor(q) < f64::from(z) && element.form_factor(q) > 0.0);
            prop_assert!(element.incoherent(0.0) == 0.0 && element.incoherent(q) > 0.0);
            prop_assert!(element.incoherent(q) < f64::from(z) * 1.001);
        }
    }

    /// Integrating Thomson × F² and Klein–Nishina × S gives the tabulated cross sections back.
    ///
    /// σ = ½ π rₑ² N_A Σ w/A ∫ … dcos; 4 % for Rayleigh, whose table includes anomalous scattering.
    #[test]
    fn cross_sections_are_the_integrals_of_their_distributions() {
        const THOMSON_CM2_MOL: f64 = 0.079_407_877 * 6.022_140_76e-1; // rₑ² in barn × N_A × 1e-24
        for (name, energy_kev, tolerance) in [
            ("water", 20.0, 0.02),
            ("water", 80.0, 0.02),
            ("titanium", 60.0, 0.04),
        ] {
            let material = Material::named(name).unwrap();
            let alpha = energy_kev / ELECTRON_REST_KEV;
            let (mut rayleigh, mut compton, n) = (0.0, 0.0, 4000);
            for i in 0..n {
                let s = (f64::from(i) + 0.5) / f64::from(n);
                let (cos, q) = (1.0 - 2.0 * s * s, s * energy_kev / HC_KEV_ANGSTROM);
                let ratio = 1.0 / (1.0 + alpha * (1.0 - cos));
                let solid_angle = 2.0 * std::f64::consts::PI * 4.0 * s / f64::from(n);
                rayleigh += solid_angle
                    * 0.5
                    * (1.0 + cos * cos)
                    * material.form_factor_squared_per_gram(q);
                compton += solid_angle
                    * 0.5
                    * ratio.powi(2)
                    * (ratio + 1.0 / ratio - 1.0 + cos * cos)
                    * material.incoherent_per_gram(q);
            }
            let table = material.cross_sections(energy_kev).unwrap();
            for (integral, table) in [(rayleigh, table.rayleigh), (compton, table.compton)] {
                let ratio = integral * THOMSON_CM2_MOL / table;
                assert!(
                    (ratio - 1.0).abs() < tolerance,
                    "{name} at {energy_kev} keV: {ratio}"
                );
            }
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
        let parsed = Material::parse_composition("water", 1.0, "H:0.112, O:0.889").unwrap();
        assert!((parsed.mass_fractions()[0].1 - 0.112 / 1.001).abs() < 1e-15);
    }
}
