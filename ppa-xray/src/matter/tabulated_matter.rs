//! Photon data of one material, checked and ready for use.

use crate::matter::cross_sections::{CrossSections, LogLog, SectionTables};
use crate::matter::electron_shell::Shell;
use crate::matter::energy_range::{MAX_ENERGY_KEV, MIN_ENERGY_KEV};
use crate::matter::material_error::MaterialError;
use crate::matter::photon_tables::PhotonTables;

/// Hartree in keV and Bohr's radius in Å (CODATA 2018).
const HARTREE_KEV: f64 = 0.027_211_386_245_988;
const BOHR_ANGSTROM: f64 = 0.529_177_210_903;

/// Validated tables, ready for interpolation.
#[derive(Debug, PartialEq)]
pub(crate) struct TabulatedMatter {
    range_kev: [f64; 2],
    sections: SectionTables,
    form_factor_squared: LogLog,
    first_form_factor: [f64; 2],
    shells: Vec<Shell>,
}

impl TabulatedMatter {
    pub(crate) fn new(name: &str, tables: &PhotonTables) -> Result<Self, MaterialError> {
        let energies = &tables.energies_kev;
        ascending(name, "energies in keV", energies, true)?;
        let range_kev = [
            energies[0].max(MIN_ENERGY_KEV),
            energies[energies.len() - 1].min(MAX_ENERGY_KEV),
        ];
        if range_kev[0].partial_cmp(&range_kev[1]) != Some(std::cmp::Ordering::Less) {
            return Err(MaterialError::TableRange {
                name: name.to_owned(),
                low_kev: energies[0],
                high_kev: energies[energies.len() - 1],
            });
        }
        let columns = [
            ("photoelectric cross sections", &tables.photoelectric_cm2_g),
            ("Rayleigh cross sections", &tables.rayleigh_cm2_g),
            ("Compton cross sections", &tables.compton_cm2_g),
        ];
        for (what, values) in columns {
            if values.len() != energies.len() {
                return Err(MaterialError::TableLength {
                    name: name.to_owned(),
                    what,
                    found: values.len(),
                    expected: energies.len(),
                });
            }
            not_negative(name, what, values)?;
        }
        let (q_squared, squared): (Vec<f64>, Vec<f64>) = tables
            .form_factor_squared
            .iter()
            .map(|&[x, y]| (x, y))
            .unzip();
        ascending(name, "squared momentum transfers", &q_squared, false)?;
        // A node at q = 0 has no logarithm; its value only determines the values below the next node.
        let positive = usize::from(q_squared[0] == 0.0);
        if q_squared.len() - positive < 2 {
            return Err(MaterialError::TableLength {
                name: name.to_owned(),
                what: "positive squared momentum transfers",
                found: q_squared.len() - positive,
                expected: 2,
            });
        }
        not_negative(name, "squared form factors", &squared)?;
        if squared[0] == 0.0 {
            return Err(table_value(
                name,
                "squared form factors",
                (0, 0.0),
                POSITIVE,
            ));
        }
        if tables.shells.is_empty() {
            return Err(MaterialError::TableLength {
                name: name.to_owned(),
                what: "electron shells",
                found: 0,
                expected: 1,
            });
        }
        for (index, shell) in tables.shells.iter().enumerate() {
            for (what, value, fine, expected) in [
                (
                    "electrons of shells",
                    shell.electrons,
                    shell.electrons > 0.0,
                    POSITIVE,
                ),
                (
                    "binding energies of shells",
                    shell.binding_kev,
                    shell.binding_kev >= 0.0,
                    NOT_NEGATIVE,
                ),
                (
                    "Compton profiles of shells",
                    shell.profile_at_zero,
                    shell.profile_at_zero > 0.0,
                    POSITIVE,
                ),
            ] {
                if !(fine && value.is_finite()) {
                    return Err(table_value(name, what, (index, value), expected));
                }
            }
        }
        let section = |values: &[f64]| LogLog::new(energies, values);
        Ok(Self {
            range_kev,
            sections: SectionTables {
                photoelectric: section(&tables.photoelectric_cm2_g),
                rayleigh: section(&tables.rayleigh_cm2_g),
                compton: section(&tables.compton_cm2_g),
            },
            first_form_factor: [q_squared[positive], squared[0]],
            form_factor_squared: LogLog::new(&q_squared[positive..], &squared[positive..]),
            shells: tables.shells.clone(),
        })
    }

    pub(crate) fn range_kev(&self) -> [f64; 2] {
        self.range_kev
    }

    pub(crate) fn shells(&self) -> &[Shell] {
        &self.shells
    }

    pub(crate) fn cross_sections(&self, energy_kev: f64) -> CrossSections {
        self.sections
            .at(energy_kev.clamp(self.range_kev[0], self.range_kev[1]))
    }

    pub(crate) fn edges_kev(&self) -> impl Iterator<Item = f64> {
        self.sections.photoelectric.edges()
    }

    pub(crate) fn form_factor_squared(&self, q: f64) -> f64 {
        let x = q * q;
        let [first, value] = self.first_form_factor;
        if x < first {
            let at_first = self.form_factor_squared.at(first.ln());
            value + (at_first - value) * x / first
        } else {
            self.form_factor_squared.at(x.ln())
        }
    }

    /// S(q) of the shells: electrons that the momentum transfer ħk can free, n(k/2 − U/k) in atomic units.
    pub(crate) fn incoherent(&self, q: f64) -> f64 {
        let transfer = 4.0 * std::f64::consts::PI * q * BOHR_ANGSTROM;
        self.shells
            .iter()
            .map(|shell| {
                let fastest = 0.5 * transfer - shell.binding_kev / HARTREE_KEV / transfer;
                if fastest.is_nan() {
                    0.0 // a free electron at q = 0
                } else {
                    shell.electrons * shell.electrons_below(fastest)
                }
            })
            .sum()
    }
}

const NOT_NEGATIVE: &str = "zero or more";
const POSITIVE: &str = "more than zero";

fn table_value(
    name: &str,
    what: &'static str,
    (index, found): (usize, f64),
    expected: &'static str,
) -> MaterialError {
    MaterialError::TableValue {
        name: name.to_owned(),
        what,
        index,
        found,
        expected,
    }
}

fn not_negative(name: &str, what: &'static str, values: &[f64]) -> Result<(), MaterialError> {
    match values.iter().position(|v| !(v.is_finite() && *v >= 0.0)) {
        Some(bad) => Err(table_value(name, what, (bad, values[bad]), NOT_NEGATIVE)),
        None => Ok(()),
    }
}

/// Checks for at least two finite, non-negative, ascending values; with `edges` a value may occur twice.
fn ascending(
    name: &str,
    what: &'static str,
    values: &[f64],
    edges: bool,
) -> Result<(), MaterialError> {
    not_negative(name, what, values)?;
    let mut distinct = values.to_vec();
    distinct.dedup();
    if distinct.len() < 2 {
        return Err(MaterialError::TableLength {
            name: name.to_owned(),
            what,
            found: distinct.len(),
            expected: 2,
        });
    }
    let descends = |i: usize| {
        values[i] < values[i - 1]
            || values[i] == values[i - 1] && (!edges || i >= 2 && values[i - 2] == values[i])
    };
    match (1..values.len()).find(|&i| descends(i)) {
        Some(index) => Err(MaterialError::TableOrder {
            name: name.to_owned(),
            what,
            index,
            found: values[index],
            before: values[index - 1],
        }),
        None => Ok(()),
    }
}
