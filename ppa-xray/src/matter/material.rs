//! Materials: elements by weight or photon tables, and their cross sections per gram.

use std::sync::Arc;

use crate::{
    matter::composition::Composition,
    matter::cross_sections::CrossSections,
    matter::electron_shell::Shell,
    matter::energy_nodes::energy_nodes,
    matter::energy_range::{MAX_ENERGY_KEV, MIN_ENERGY_KEV},
    matter::fluorescence::{FluorescenceLine, KFluorescence},
    matter::form_factors::FormFactors,
    matter::library,
    matter::material_error::MaterialError,
    matter::molecular_form_factors::Measured,
    matter::molecular_scatter::{MolecularScatter, Part},
    matter::photon_tables::PhotonTables,
    matter::tabulated_matter::TabulatedMatter,
};

/// A homogeneous material: elements by mass fraction, or its own photon tables, and a nominal density.
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
    /// Shares of the mass with and without a measured form factor; empty if there is none.
    parts: Vec<Part>,
    /// Coherent scattering by molecular form factors, if chosen.
    molecular: Option<Arc<MolecularScatter>>,
}

/// Source of the photon data.
#[derive(Clone, Debug, PartialEq)]
enum Matter {
    /// Embedded data of the elements, by mass fraction.
    Elements(Composition),
    Tables(Arc<TabulatedMatter>),
}

impl Material {
    /// Builds a material from (atomic number, mass fraction) pairs, Z = 1 to 92.
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
        let composition = Composition::new(&name, mass_fractions);
        Self::from_elements(name, density_g_cm3, composition)
    }

    fn from_elements(
        name: String,
        density_g_cm3: f64,
        composition: Result<Composition, MaterialError>,
    ) -> Result<Self, MaterialError> {
        check_density(&name, density_g_cm3)?;
        Ok(Self {
            name,
            density_g_cm3,
            matter: Matter::Elements(composition?),
            parts: Vec::new(),
            molecular: None,
        })
    }

    /// Builds a material from its own photon data.
    ///
    /// # Errors
    /// A density that is not positive; tables that are empty, of different lengths, not ascending, negative or not
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
            parts: Vec::new(),
            molecular: None,
        })
    }

    /// The same elements, with measured form factors for these shares of the mass.
    pub(crate) fn measured_as(mut self, shares: &[(Measured, f64)]) -> Self {
        if let Matter::Elements(composition) = &self.matter {
            let part = |&(measured, share): &(Measured, f64)| Part {
                share,
                composition: composition.clone(),
                measured: Some(measured),
            };
            self.parts = shares.iter().map(part).collect();
        }
        self
    }

    /// The same material with Rayleigh scattering by other form factors.
    ///
    /// [`FormFactors::Molecular`] changes materials of the library that have a measured form factor, and mixtures of them. Their Rayleigh
    /// cross section becomes the integral of Thomson's law times the square of that form factor. Other
    /// materials, and those made from tables, are unchanged.
    #[must_use]
    pub fn with_form_factors(mut self, form_factors: FormFactors) -> Self {
        self.molecular = match form_factors {
            FormFactors::Molecular if !self.parts.is_empty() => {
                Some(Arc::new(MolecularScatter::new(&self.parts)))
            }
            _ => None,
        };
        self
    }

    /// The form factors used for Rayleigh scattering; [`FormFactors::Molecular`] if a measured one contributes.
    #[must_use]
    pub fn form_factors(&self) -> FormFactors {
        if self.molecular.is_some() {
            FormFactors::Molecular
        } else {
            FormFactors::IndependentAtoms
        }
    }

    /// Builds a material from text such as `Ca:0.4,O:0.6`: symbols and mass fractions.
    ///
    /// # Errors
    /// Text that does not parse, and the errors of [`Material::from_composition`].
    pub fn parse_composition(
        name: impl Into<String>,
        density_g_cm3: f64,
        composition: &str,
    ) -> Result<Self, MaterialError> {
        let name = name.into();
        let composition = Composition::parse(&name, composition);
        Self::from_elements(name, density_g_cm3, composition)
    }

    /// Mixes materials by mass fraction. The mixture scatters by molecular form factors if one of its parts does.
    ///
    /// # Errors
    /// The errors of [`Material::from_composition`], and a part made from tables, whose elements are not known.
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
        let mut mixture = Self::from_composition(name, density_g_cm3, &mass)?;
        mixture.parts = mixed(parts);
        let molecular = |(part, _): &(&Self, f64)| part.molecular.is_some();
        Ok(if parts.iter().any(molecular) {
            mixture.with_form_factors(FormFactors::Molecular)
        } else {
            mixture
        })
    }

    /// Returns a material of the library, such as `water`, `bone_cortical` or `titanium`, or a pure element by symbol, such as `Al`.
    ///
    /// # Errors
    /// A name that is neither listed by [`Material::names`] nor the symbol of an element with a measured density, H to U except At and Fr.
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

    /// Source of the composition of a named material; `None` for names that are not in the library.
    #[must_use]
    pub fn source_of(name: &str) -> Option<&'static str> {
        library::names_and_sources()
            .find(|(known, _)| known.eq_ignore_ascii_case(name))
            .map(|(_, source)| source)
    }

    /// Name of the material.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Nominal density in g/cm³; the transport uses the density of the voxel instead.
    #[must_use]
    pub fn density_g_cm3(&self) -> f64 {
        self.density_g_cm3
    }

    /// Atomic numbers and mass fractions, ascending in Z; the fractions add up to 1. Empty if made from tables.
    #[must_use]
    pub fn mass_fractions(&self) -> &[(u8, f64)] {
        self.elements().map_or(&[], Composition::mass_fractions)
    }

    fn elements(&self) -> Option<&Composition> {
        match &self.matter {
            Matter::Elements(composition) => Some(composition),
            Matter::Tables(_) => None,
        }
    }

    /// The mass fractions in the format of [`Material::parse_composition`]. Empty if made from tables.
    #[must_use]
    pub fn composition(&self) -> String {
        self.elements().map(Composition::text).unwrap_or_default()
    }

    /// Energy range of the data in keV: 1 to 150, or the part of it that the material's own tables cover.
    ///
    /// The transport uses the values at the lower end for photons scattered to lower energies.
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

    /// The same as [`Material::cross_sections`] for an energy known to be inside 1 to 150 keV. Beyond the material's own tables, returns
    /// the values at the nearer end.
    pub(crate) fn cross_sections_unchecked(&self, energy_kev: f64) -> CrossSections {
        let sections = match &self.matter {
            Matter::Elements(composition) => composition.cross_sections(energy_kev),
            Matter::Tables(tables) => tables.cross_sections(energy_kev),
        };
        match &self.molecular {
            Some(molecular) => CrossSections {
                rayleigh: molecular.rayleigh_cm2_g(energy_kev),
                ..sections
            },
            None => sections,
        }
    }

    /// [`Material::cross_sections_unchecked`] at [`energy_nodes`].
    pub(crate) fn cross_sections_at_nodes(&self) -> Vec<CrossSections> {
        let mut sections = match &self.matter {
            Matter::Elements(composition) => composition.cross_sections_at_nodes(),
            Matter::Tables(tables) => energy_nodes().map(|e| tables.cross_sections(e)).collect(),
        };
        if let Some(molecular) = &self.molecular {
            molecular.replace_at_nodes(&mut sections);
        }
        sections
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

    /// Σ w/A · S(q): scattering electrons per unit mass, up to a constant.
    pub(crate) fn incoherent_per_gram(&self, q: f64) -> f64 {
        match &self.matter {
            Matter::Elements(composition) => composition.incoherent(q),
            Matter::Tables(tables) => tables.incoherent(q),
        }
    }

    /// F²(q) per unit mass up to a constant, Σ w/A · F² for independent atoms.
    pub(crate) fn form_factor_squared_per_gram(&self, q: f64) -> f64 {
        if let Some(molecular) = &self.molecular {
            return molecular.form_factor_squared(q);
        }
        match &self.matter {
            Matter::Elements(composition) => composition.form_factor_squared(q),
            Matter::Tables(tables) => tables.form_factor_squared(q),
        }
    }

    /// Electron shells, their electrons per unit mass up to a constant.
    pub(crate) fn shells(&self) -> Vec<Shell> {
        match &self.matter {
            Matter::Elements(composition) => composition.shells(),
            Matter::Tables(tables) => tables.shells().to_vec(),
        }
    }

    /// K photons that may follow photoelectric absorption at an energy; empty for a material made from tables.
    #[must_use]
    pub fn k_fluorescence(&self, energy_kev: f64) -> Vec<FluorescenceLine> {
        self.k_emitters()
            .filter(|(_, k)| energy_kev > k.edge_kev)
            .flat_map(|(z, k)| k.lines(self.photoelectric_share(z, energy_kev)))
            .collect()
    }

    /// Elements with K fluorescence inside the tables, by atomic number.
    pub(crate) fn k_emitters(&self) -> impl Iterator<Item = (u8, &'static KFluorescence)> {
        self.elements()
            .into_iter()
            .flat_map(Composition::k_emitters)
    }

    /// Share of an element in the photoelectric absorption.
    pub(crate) fn photoelectric_share(&self, z: u8, energy_kev: f64) -> f64 {
        self.elements()
            .map_or(0.0, |elements| elements.photoelectric_share(z, energy_kev))
    }

    /// Absorption edges in keV.
    pub(crate) fn edges_kev(&self) -> Vec<f64> {
        match &self.matter {
            Matter::Elements(composition) => composition.edges_kev().collect(),
            Matter::Tables(tables) => tables.edges_kev().collect(),
        }
    }
}

/// The parts of a mixture by mass fraction; empty if no part has a measured form factor.
fn mixed(materials: &[(&Material, f64)]) -> Vec<Part> {
    if materials
        .iter()
        .all(|(material, _)| material.parts.is_empty())
    {
        return Vec::new();
    }
    let sum: f64 = materials.iter().map(|(_, share)| share).sum();
    let mut mixed = Vec::new();
    for (material, share) in materials {
        let share = share / sum;
        match &material.matter {
            Matter::Elements(composition) if material.parts.is_empty() => mixed.push(Part {
                share,
                composition: composition.clone(),
                measured: None,
            }),
            _ => mixed.extend(material.parts.iter().map(|part| Part {
                share: share * part.share,
                ..part.clone()
            })),
        }
    }
    mixed
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
    use crate::matter::cross_sections::{ELECTRON_REST_KEV, HC_KEV_ANGSTROM};

    proptest! {
        /// The attenuation of a mixture is the weighted sum of that of its elements.
        #[test]
        fn mixtures_follow_the_weights(z1 in 1..=46_u8, z2 in 47..=92_u8, share in 0.0..1.0_f64, energy_kev in 1.0..150.0_f64) {
            let alone = |z| Material::from_composition("element", 1.0, &[(z, 1.0)]).unwrap().total_cm2_g(energy_kev).unwrap();
            let mixture = Material::from_composition("mixture", 1.0, &[(z2, 1.0 - share), (z1, share)]).unwrap();
            let expected = share * alone(z1) + (1.0 - share) * alone(z2);
            prop_assert!((mixture.total_cm2_g(energy_kev).unwrap() / expected - 1.0).abs() < 1e-12);
        }
    }

    /// The integrals of Thomson × F² and Klein–Nishina × S reproduce the tabulated cross sections.
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
}
