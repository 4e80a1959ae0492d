//! Errors of materials.

use crate::matter::energy_range::{MAX_ENERGY_KEV, MIN_ENERGY_KEV};

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
    #[error("material {name:?} lists {symbol} twice")]
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
    #[error("no material is named {name:?}; known materials are {} and the symbols of the elements H to U", known.join(", "))]
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
    #[error("{found_kev} keV is outside the tables, which cover {low_kev} to {high_kev} keV")]
    Energy {
        /// Energy asked for, keV.
        found_kev: f64,
        /// Lowest energy of the tables, keV.
        low_kev: f64,
        /// Highest energy of the tables, keV.
        high_kev: f64,
    },
    /// A mixture with a material of unknown elements.
    #[error("material {name:?} is defined by tables, but a mixture needs its elements")]
    NoComposition {
        /// Material at fault.
        name: String,
    },
    /// A table that is too short, or not as long as the others.
    #[error("material {name:?} has {found} {what}, expected {expected}{}", if *expected > 2 { "" } else { " or more" })]
    TableLength {
        /// Material at fault.
        name: String,
        /// What is counted.
        what: &'static str,
        /// Values given.
        found: usize,
        /// Values needed.
        expected: usize,
    },
    /// A value that is negative or not finite, or zero where that cannot be.
    #[error(
        "material {name:?}: number {index} of the {what}, counted from 0, is {found}, expected {expected}"
    )]
    TableValue {
        /// Material at fault.
        name: String,
        /// Which table.
        what: &'static str,
        /// Place in the table, from 0.
        index: usize,
        /// Value given.
        found: f64,
        /// What it may be.
        expected: &'static str,
    },
    /// Values that do not ascend.
    #[error(
        "material {name:?}: number {index} of the {what}, counted from 0, is {found} after {before}, expected a larger number"
    )]
    TableOrder {
        /// Material at fault.
        name: String,
        /// Which table.
        what: &'static str,
        /// Place in the table, from 0.
        index: usize,
        /// Value given.
        found: f64,
        /// The value before it.
        before: f64,
    },
    /// Tables that have no energies in common with the transport.
    #[error(
        "material {name:?} has data from {low_kev} to {high_kev} keV, nothing between {MIN_ENERGY_KEV} and {MAX_ENERGY_KEV} keV"
    )]
    TableRange {
        /// Material at fault.
        name: String,
        /// First energy, keV.
        low_kev: f64,
        /// Last energy, keV.
        high_kev: f64,
    },
}
