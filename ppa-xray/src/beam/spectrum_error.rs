//! Errors of a spectrum.

use std::path::PathBuf;

use crate::{
    matter::energy_range::{MAX_ENERGY_KEV, MIN_ENERGY_KEV},
    matter::material_error::MaterialError,
};

/// Why a spectrum is not valid.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SpectrumError {
    /// The number of edges is not the number of weights plus one.
    #[error(
        "a spectrum has {edges} edges and {weights} weights, expected one edge more than weights"
    )]
    Count {
        /// Number of edges.
        edges: usize,
        /// Number of weights.
        weights: usize,
    },
    /// The tube voltage is outside the tube model.
    #[error("tube voltage {found} kV is outside the tube model, which covers {min} to {max} kV")]
    TubeVoltage {
        /// Voltage given, kV.
        found: f64,
        /// Lowest voltage, kV.
        min: f64,
        /// Highest voltage, kV.
        max: f64,
    },
    /// The anode angle is outside the tube model.
    #[error("anode angle {found}° is outside the tube model, which covers {min}° to {max}°")]
    AnodeAngle {
        /// Angle given, degrees.
        found: f64,
        /// Smallest angle, degrees.
        min: f64,
        /// Largest angle, degrees.
        max: f64,
    },
    /// The thickness of a filter is negative or not finite.
    #[error("filter of {material} has thickness {found_mm} mm, expected zero or more")]
    FilterThickness {
        /// Name of the filter's material.
        material: String,
        /// Thickness given, mm.
        found_mm: f64,
    },
    /// A filter is not written as `Material:thickness`.
    #[error("cannot read filter {found:?}, expected Material:millimetres such as Al:2.5")]
    FilterSyntax {
        /// Text given.
        found: String,
    },
    /// The material of a filter is unknown, or an energy is outside the cross-section tables.
    #[error(transparent)]
    Material(#[from] MaterialError),
    /// The bin edges do not ascend.
    #[error("energy bin {bin} goes from {low_kev} to {high_kev} keV, expected ascending edges")]
    Edges {
        /// Index of the bin.
        bin: usize,
        /// Lower edge of the bin, keV.
        low_kev: f64,
        /// Upper edge of the bin, keV.
        high_kev: f64,
    },
    /// A weight is negative or not finite.
    #[error("energy bin {bin} has weight {found}, expected zero or more")]
    Weight {
        /// Index of the bin.
        bin: usize,
        /// Weight given.
        found: f64,
    },
    /// The spectrum has photons at energies without cross sections.
    #[error(
        "the spectrum has photons between {low_kev} and {high_kev} keV, expected photons from {MIN_ENERGY_KEV} to {MAX_ENERGY_KEV} keV only"
    )]
    Range {
        /// Lower edge of the lowest filled bin, keV.
        low_kev: f64,
        /// Upper edge of the highest filled bin, keV.
        high_kev: f64,
    },
    /// No photons are left.
    #[error("the spectrum has no photons")]
    Dark,
    /// A spectrum file cannot be used.
    #[error("spectrum {}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What is wrong with the file.
        source: Box<SpectrumError>,
    },
    /// The file cannot be read.
    #[error("cannot be read")]
    Read(#[source] std::io::Error),
    /// A line of the file is invalid.
    #[error("line {line}: found {found:?}, expected {expected}")]
    Line {
        /// Line number, from 1.
        line: usize,
        /// Text of the line.
        found: String,
        /// Expected content.
        expected: &'static str,
    },
}
