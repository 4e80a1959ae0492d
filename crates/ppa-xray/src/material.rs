//! Materials: elements by weight, and what a gram of them does to a photon.

use crate::{
    cross_sections::{
        CrossSections, ELECTRON_REST_KEV, HC_KEV_ANGSTROM, MAX_ENERGY_KEV, MIN_ENERGY_KEV, elements,
    },
    element::{atomic_number, symbol},
    library,
};

/// Why something is not a material, or has no cross section.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MaterialError {
    /// The density is not a positive, finite number.
    #[error("material {name:?} has density {found} g/cm³, expected a positive number")]
    Density {
        /// Material at fault.
        name: String,
        /// Density given, g/cm³.
        found: f64,
    },
    /// A composition without elements.
    #[error("material {name:?} has no elements")]
    Empty {
        /// Material at fault.
        name: String,
    },
    /// An element outside the tables.
    #[error("material {name:?} has an element of atomic number {z}, expected 1 to 92")]
    AtomicNumber {
        /// Material at fault.
        name: String,
        /// Atomic number given.
        z: u8,
    },
    /// The same element twice.
    #[error("material {name:?} names {symbol} twice")]
    Duplicate {
        /// Material at fault.
        name: String,
        /// Symbol of the element.
        symbol: &'static str,
    },
    /// A mass fraction that is negative or not a number.
    #[error("material {name:?} has mass fraction {found} of {symbol}, expected 0 to 1")]
    Fraction {
        /// Material at fault.
        name: String,
        /// Symbol of the element.
        symbol: &'static str,
        /// Fraction given.
        found: f64,
    },
    /// Mass fractions that do not add up.
    #[error("the mass fractions of material {name:?} add up to {found}, expected 1 within 1 %")]
    Sum {
        /// Material at fault.
        name: String,
        /// Sum of the fractions given.
        found: f64,
    },
    /// A name that is not in the library.
    #[error("no material is named {name:?}; known are {} and the symbols of the elements H to U", known.join(", "))]
    Unknown {
        /// Name given.
        name: String,
        /// Names in the library.
        known: Vec<&'static str>,
    },
    /// A composition that cannot be read.
    #[error("cannot read {found:?} in a composition, expected Symbol:fraction such as Ca:0.4")]
    Syntax {
        /// The part at fault.
        found: String,
    },
    /// An energy outside the tables.
    #[error(
        "{found_kev} keV is outside the tables, which go from {MIN_ENERGY_KEV} to {MAX_ENERGY_KEV} keV"
    )]
    Energy {
        /// Energy asked for, keV.
        found_kev: f64,
    },
}

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
            let ratio = 1.0 / (1.0 + alpha * (1.0 - cos));
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

    fn elements(&self) -> impl Iterator<Item = (&'static crate::cross_sections::Element, f64)> {
        self.mass_fractions.iter().map(|&(z, fraction)| {
            (
                elements().get(z).expect("Z checked on the way in"),
                fraction,
            )
        })
    }
}
