//! Materials: elements by weight or tables, and what a gram of them does to a photon.

use std::sync::Arc;

use crate::{
    matter::cross_sections::{
        CrossSections, ELECTRON_REST_KEV, Element, HC_KEV_ANGSTROM, MAX_ENERGY_KEV, MIN_ENERGY_KEV,
        elements,
    },
    matter::electron_shell::Shell,
    matter::element::{atomic_number, symbol},
    matter::fluorescence::{FluorescenceLine, KFluorescence},
    matter::klein_nishina::energy_ratio,
    matter::library,
    matter::material_error::MaterialError,
    matter::photon_tables::{PhotonTables, TabulatedMatter},
};

/// A homogeneous material: elements by mass fraction, or tables of its own, and a nominal density.
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
    matter: Matter,
}

/// Where the photon data comes from.
#[derive(Clone, Debug, PartialEq)]
enum Matter {
    /// The embedded data of the elements, by mass fraction.
    Elements(Vec<(u8, f64)>),
    Tables(Arc<TabulatedMatter>),
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
        check_density(&name, density_g_cm3)?;
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
            matter: Matter::Elements(sorted),
        })
    }

    /// Material from photon data of its own.
    ///
    /// # Errors
    /// A density that is not positive; tables that are empty, of unlike lengths, not ascending, negative or not
    /// finite, or outside 1 to 150 keV.
    pub fn from_tables(
        name: impl Into<String>,
        tables: &PhotonTables,
    ) -> Result<Self, MaterialError> {
        let name = name.into();
        check_density(&name, tables.density_g_cm3)?;
        let matter = Matter::Tables(Arc::new(TabulatedMatter::new(&name, tables)?));
        Ok(Self {
            name,
            density_g_cm3: tables.density_g_cm3,
            matter,
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
    /// Everything [`Material::from_composition`] refuses, and a part made from tables, whose elements are not known.
    pub fn mixture(
        name: impl Into<String>,
        density_g_cm3: f64,
        parts: &[(&Self, f64)],
    ) -> Result<Self, MaterialError> {
        let mut mass = std::collections::BTreeMap::<u8, f64>::new();
        for (part, share) in parts {
            if part.mass_fractions().is_empty() {
                return Err(MaterialError::NoComposition {
                    name: part.name.clone(),
                });
            }
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
        library::names_and_sources().map(|(name, _)| name)
    }

    /// Where the composition of a named material comes from; nothing for names that are not in the library.
    #[must_use]
    pub fn source_of(name: &str) -> Option<&'static str> {
        library::names_and_sources()
            .find(|(known, _)| known.eq_ignore_ascii_case(name))
            .map(|(_, source)| source)
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

    /// Atomic numbers and mass fractions, ascending in Z; the fractions add up to 1. Empty if made from tables.
    #[must_use]
    pub fn mass_fractions(&self) -> &[(u8, f64)] {
        match &self.matter {
            Matter::Elements(mass_fractions) => mass_fractions,
            Matter::Tables(_) => &[],
        }
    }

    /// The mass fractions as [`Material::parse_composition`] reads them. Empty if made from tables.
    #[must_use]
    pub fn composition(&self) -> String {
        let parts = self.mass_fractions().iter().map(|&(z, fraction)| {
            let symbol = symbol(z).expect("Z checked on the way in");
            format!("{symbol}:{}", (fraction * 1e7).round() / 1e7)
        });
        parts.collect::<Vec<_>>().join(",")
    }

    /// Energies in keV between which the material has data: 1 to 150, or what its own tables hold of that.
    ///
    /// Transport takes the values at the lower end for photons that scatter to below it.
    #[must_use]
    pub fn energy_range_kev(&self) -> [f64; 2] {
        match &self.matter {
            Matter::Elements(_) => [MIN_ENERGY_KEV, MAX_ENERGY_KEV],
            Matter::Tables(tables) => tables.range_kev(),
        }
    }

    /// Mass attenuation by interaction at 1 to 150 keV.
    ///
    /// # Errors
    /// An energy outside the tables.
    pub fn cross_sections(&self, energy_kev: f64) -> Result<CrossSections, MaterialError> {
        let [low_kev, high_kev] = self.energy_range_kev();
        if !(low_kev..=high_kev).contains(&energy_kev) {
            return Err(MaterialError::Energy {
                found_kev: energy_kev,
                low_kev,
                high_kev,
            });
        }
        Ok(self.cross_sections_unchecked(energy_kev))
    }

    /// As [`Material::cross_sections`] at an energy known to be inside 1 to 150 keV; beyond tables of its own, the values
    /// at their nearer end.
    pub(crate) fn cross_sections_unchecked(&self, energy_kev: f64) -> CrossSections {
        match &self.matter {
            Matter::Elements(mass_fractions) => of_elements(mass_fractions)
                .fold(CrossSections::default(), |sum, (element, w)| {
                    sum + element.cross_sections(energy_kev).scaled(w)
                }),
            Matter::Tables(tables) => tables.cross_sections(energy_kev),
        }
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
        match &self.matter {
            Matter::Elements(mass_fractions) => of_elements(mass_fractions)
                .map(|(element, w)| w / element.atomic_weight * element.incoherent(q))
                .sum(),
            Matter::Tables(tables) => tables.incoherent(q),
        }
    }

    /// Σ w/A · F²(q), independent atoms, up to a constant.
    pub(crate) fn form_factor_squared_per_gram(&self, q: f64) -> f64 {
        match &self.matter {
            Matter::Elements(mass_fractions) => of_elements(mass_fractions)
                .map(|(element, w)| w / element.atomic_weight * element.form_factor(q).powi(2))
                .sum(),
            Matter::Tables(tables) => tables.form_factor_squared(q),
        }
    }

    /// Electron shells, their electrons per unit mass up to a constant.
    pub(crate) fn shells(&self) -> Vec<Shell> {
        match &self.matter {
            Matter::Elements(mass_fractions) => of_elements(mass_fractions)
                .flat_map(|(element, w)| {
                    element.shells().iter().map(move |shell| Shell {
                        electrons: shell.electrons * w / element.atomic_weight,
                        ..*shell
                    })
                })
                .collect(),
            Matter::Tables(tables) => tables.shells().to_vec(),
        }
    }

    /// K photons that may follow photoelectric absorption at an energy; none of a material made from tables.
    #[must_use]
    pub fn k_fluorescence(&self, energy_kev: f64) -> Vec<FluorescenceLine> {
        self.k_emitters()
            .filter(|(_, k)| energy_kev > k.edge_kev)
            .flat_map(|(z, k)| k.lines(self.photoelectric_share(z, energy_kev)))
            .collect()
    }

    /// Elements with K fluorescence inside the tables, by atomic number.
    pub(crate) fn k_emitters(&self) -> impl Iterator<Item = (u8, &'static KFluorescence)> {
        self.mass_fractions()
            .iter()
            .zip(of_elements(self.mass_fractions()))
            .filter_map(|(&(z, _), (element, _))| Some((z, element.k_fluorescence()?)))
    }

    /// Share of an element in the photoelectric absorption.
    pub(crate) fn photoelectric_share(&self, z: u8, energy_kev: f64) -> f64 {
        let whole = self.cross_sections_unchecked(energy_kev).photoelectric;
        let part: f64 = self
            .mass_fractions()
            .iter()
            .zip(of_elements(self.mass_fractions()))
            .filter(|((other, _), _)| *other == z)
            .map(|(_, (element, w))| w * element.cross_sections(energy_kev).photoelectric)
            .sum();
        part / whole
    }

    /// Absorption edges in keV.
    pub(crate) fn edges_kev(&self) -> Vec<f64> {
        match &self.matter {
            Matter::Elements(mass_fractions) => of_elements(mass_fractions)
                .flat_map(|(element, _)| element.edges_kev())
                .collect(),
            Matter::Tables(tables) => tables.edges_kev().collect(),
        }
    }
}

fn of_elements(mass_fractions: &[(u8, f64)]) -> impl Iterator<Item = (&'static Element, f64)> {
    mass_fractions.iter().map(|&(z, fraction)| {
        (
            elements().get(z).expect("Z checked on the way in"),
            fraction,
        )
    })
}

fn check_density(name: &str, density_g_cm3: f64) -> Result<(), MaterialError> {
    if density_g_cm3.is_finite() && density_g_cm3 > 0.0 {
        Ok(())
    } else {
        Err(MaterialError::Density {
            name: name.to_owned(),
            found: density_g_cm3,
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
        let again = Material::parse_composition("water", 1.0, &water.composition()).unwrap();
        assert!((again.mass_fractions()[1].1 - water.mass_fractions()[1].1).abs() < 1e-7);
        let parsed = Material::parse_composition("water", 1.0, "H:0.112, O:0.889").unwrap();
        assert!((parsed.mass_fractions()[0].1 - 0.112 / 1.001).abs() < 1e-15);
    }

    /// Water as its tables, on the nodes of a file.
    fn water_tables() -> PhotonTables {
        let water = Material::named("water").unwrap();
        let energies_kev: Vec<f64> = (0..=2300).map(|i| 5.0 + 0.05 * f64::from(i)).collect();
        let of = |part: fn(&CrossSections) -> f64| {
            let value = |&e: &f64| part(&water.cross_sections(e).unwrap());
            energies_kev.iter().map(value).collect()
        };
        let squared = |i: u32| {
            let q = 0.01 * f64::from(i);
            [q * q, 7.0 * water.form_factor_squared_per_gram(q)]
        };
        let shell = |electrons, binding_kev, profile_at_zero| Shell {
            electrons,
            binding_kev,
            profile_at_zero,
        };
        PhotonTables {
            density_g_cm3: 1.0,
            photoelectric_cm2_g: of(|s| s.photoelectric),
            compton_cm2_g: of(|s| s.compton),
            rayleigh_cm2_g: of(|s| s.rayleigh),
            energies_kev,
            form_factor_squared: (0..=1000).map(squared).collect(),
            shells: vec![
                shell(2.0, 0.0136, 0.849),
                shell(4.0, 0.0071, 0.35),
                shell(2.0, 0.0285, 0.579),
                shell(2.0, 0.532, 0.113),
            ],
        }
    }

    #[test]
    fn tables_give_their_material_back() {
        let water = Material::named("water").unwrap();
        let tables = Material::from_tables("file", &water_tables()).unwrap();
        assert_eq!(tables.energy_range_kev(), [5.0, 120.0]);
        for energy_kev in [5.0, 12.34, 59.99, 120.0] {
            let (ours, theirs) = (
                tables.cross_sections(energy_kev).unwrap(),
                water.cross_sections(energy_kev).unwrap(),
            );
            assert!((ours.total() / theirs.total() - 1.0).abs() < 1e-4);
            assert!((ours.compton / theirs.compton - 1.0).abs() < 1e-4);
        }
        for q in [0.0, 0.004, 0.123, 1.0, 9.9] {
            let ratio = tables.form_factor_squared_per_gram(q)
                / water.form_factor_squared_per_gram(q)
                / 7.0;
            assert!((ratio - 1.0).abs() < 2e-3, "{q}: {ratio}");
        }
        // Every electron scatters far out; the profiles' S(q) is that of the atoms within a tenth.
        for (q, tolerance) in [(0.3, 0.12), (1.0, 0.05), (8.0, 0.01)] {
            let ours = tables.incoherent_per_gram(q) / 10.0;
            let theirs = water.incoherent_per_gram(q) * 18.015 / 10.0;
            assert!(
                (ours / theirs - 1.0).abs() < tolerance,
                "{q}: {ours} {theirs}"
            );
        }
        assert!(matches!(
            tables.total_cm2_g(4.9),
            Err(MaterialError::Energy { .. })
        ));
        assert!(matches!(
            Material::mixture("mixture", 1.0, &[(&tables, 0.5), (&water, 0.5)]),
            Err(MaterialError::NoComposition { .. })
        ));
    }

    #[test]
    fn tables_that_make_no_sense_are_refused() {
        let broken = |change: fn(&mut PhotonTables)| {
            let mut tables = water_tables();
            change(&mut tables);
            Material::from_tables("file", &tables).unwrap_err()
        };
        type Change = fn(&mut PhotonTables);
        let values: [Change; 7] = [
            |t| t.energies_kev[3] = f64::NAN,
            |t| t.compton_cm2_g[7] = -1.0,
            |t| t.photoelectric_cm2_g[0] = f64::INFINITY,
            |t| t.form_factor_squared[0][1] = 0.0,
            |t| t.shells[1].electrons = 0.0,
            |t| t.shells[1].binding_kev = -0.1,
            |t| t.shells[1].profile_at_zero = f64::NAN,
        ];
        for change in values {
            let error = broken(change);
            assert!(matches!(error, MaterialError::TableValue { .. }), "{error}");
        }
        let lengths: [Change; 6] = [
            |t| t.energies_kev.clear(),
            |t| t.energies_kev.truncate(1),
            |t| t.rayleigh_cm2_g.truncate(9),
            |t| t.form_factor_squared.clear(),
            |t| t.form_factor_squared.truncate(2),
            |t| t.shells.clear(),
        ];
        for change in lengths {
            let error = broken(change);
            assert!(
                matches!(error, MaterialError::TableLength { .. }),
                "{error}"
            );
        }
        let orders: [Change; 3] = [
            |t| t.energies_kev.swap(4, 5),
            |t| t.energies_kev[4..7].fill(5.3),
            |t| t.form_factor_squared[4][0] = 0.0,
        ];
        for change in orders {
            let error = broken(change);
            assert!(matches!(error, MaterialError::TableOrder { .. }), "{error}");
        }
        assert!(matches!(
            broken(|t| t.density_g_cm3 = 0.0),
            MaterialError::Density { .. }
        ));
        assert!(matches!(
            broken(|t| t.energies_kev.iter_mut().for_each(|e| *e *= 1e3)),
            MaterialError::TableRange { .. }
        ));
    }
}
