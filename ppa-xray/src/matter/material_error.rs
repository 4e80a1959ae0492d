//! Errors of materials.

use crate::matter::energy_range::{MAX_ENERGY_KEV, MIN_ENERGY_KEV};

/// Why a material or a cross section is not valid.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MaterialError {
    /// The density is not a positive, finite number.
    #[error("material {name:?} has density {found} g/cm³, expected a positive number")]
    Density {
        /// Name of the material.
        name: String,
        /// Density given, g/cm³.
        found: f64,
    },
    /// The composition has no elements.
    #[error("material {name:?} has no elements")]
    Empty {
        /// Name of the material.
        name: String,
    },
    /// An element is outside the tables.
    #[error("material {name:?} has an element of atomic number {z}, expected 1 to 92")]
    AtomicNumber {
        /// Name of the material.
        name: String,
        /// Atomic number given.
        z: u8,
    },
    /// The same element occurs twice.
    #[error("material {name:?} lists {symbol} twice")]
    Duplicate {
        /// Name of the material.
        name: String,
        /// Symbol of the element.
        symbol: &'static str,
    },
    /// A mass fraction is negative or not a number.
    #[error("material {name:?} has mass fraction {found} of {symbol}, expected 0 to 1")]
    Fraction {
        /// Name of the material.
        name: String,
        /// Symbol of the element.
        symbol: &'static str,
        /// Fraction given.
        found: f64,
    },
    /// The mass fractions do not add up to 1.
    #[error("the mass fractions of material {name:?} add up to {found}, expected 1 within 1 %")]
    Sum {
        /// Name of the material.
        name: String,
        /// Sum of the fractions given.
        found: f64,
    },
    /// The name is not in the library.
    #[error("no material is named {name:?}; known materials are {} and the symbols of the elements H to U except At and Fr, whose densities are not known", known.join(", "))]
    Unknown {
        /// Name given.
        name: String,
        /// Names in the library.
        known: Vec<&'static str>,
    },
    /// A composition cannot be parsed.
    #[error("cannot read {found:?} in a composition, expected Symbol:fraction such as Ca:0.4")]
    Syntax {
        /// The invalid part of the text.
        found: String,
    },
    /// The energy is outside the tables.
    #[error("{found_kev} keV is outside the tables, which cover {low_kev} to {high_kev} keV")]
    Energy {
        /// Energy requested, keV.
        found_kev: f64,
        /// Lowest energy of the tables, keV.
        low_kev: f64,
        /// Highest energy of the tables, keV.
        high_kev: f64,
    },
    /// A mixture contains a material of unknown elements.
    #[error("material {name:?} is defined by tables, but a mixture needs its elements")]
    NoComposition {
        /// Name of the material.
        name: String,
    },
    /// A table is too short, or its length differs from the others.
    #[error("material {name:?} has {found} {what}, expected {expected}{}", if *expected > 2 { "" } else { " or more" })]
    TableLength {
        /// Name of the material.
        name: String,
        /// Name of the values.
        what: &'static str,
        /// Number of values given.
        found: usize,
        /// Number of values needed.
        expected: usize,
    },
    /// A value is negative, not finite, or zero where it must be positive.
    #[error(
        "material {name:?}: number {index} of the {what}, counted from 0, is {found}, expected {expected}"
    )]
    TableValue {
        /// Name of the material.
        name: String,
        /// Name of the table.
        what: &'static str,
        /// Index in the table, from 0.
        index: usize,
        /// Value given.
        found: f64,
        /// Allowed values.
        expected: &'static str,
    },
    /// The values of a table do not ascend.
    #[error(
        "material {name:?}: number {index} of the {what}, counted from 0, is {found} after {before}, expected a larger number"
    )]
    TableOrder {
        /// Name of the material.
        name: String,
        /// Name of the table.
        what: &'static str,
        /// Index in the table, from 0.
        index: usize,
        /// Value given.
        found: f64,
        /// The value before it.
        before: f64,
    },
    /// The tables have no energies in common with the transport.
    #[error(
        "material {name:?} has data from {low_kev} to {high_kev} keV, nothing between {MIN_ENERGY_KEV} and {MAX_ENERGY_KEV} keV"
    )]
    TableRange {
        /// Name of the material.
        name: String,
        /// First energy, keV.
        low_kev: f64,
        /// Last energy, keV.
        high_kev: f64,
    },
}
