//! Energies of the quadrature over the spectrum, with the attenuation and scattering of every material.
//!
//! docs/physics.md, "Fast engine", first collisions and single scatter.

use rayon::prelude::*;

use crate::beam::heel::Mixture;
use crate::beam::spectral_lines::SpectralLines;
use crate::engine::attenuation_basis::LANES;
use crate::engine::exposure::Exposure;
use crate::engine::line_scattering::LineScattering;
use crate::engine::paths::Paths;
use crate::engine::scatter_table::ScatterTable;
use crate::engine::spectral_quadrature::{Accuracy, compressed};
use crate::matter::sampler::MaterialTables;
use crate::matter::scatter_density::ScatterDensities;
use crate::transport::attenuation::Coefficients;
use crate::vector_math::WIDTH;

/// Energies of a quadrature, the same for all spectra of the emitter.
pub(crate) struct Lines {
    lines: Vec<Line>,
    spectra: SpectralLines,
    /// By material.
    scattering: Vec<LineScattering>,
    /// Attenuation of every basis material, line by line, padded.
    attenuation: Vec<Vec<f32>>,
}

/// An energy of a quadrature.
pub(crate) struct Line {
    pub energy_kev: f64,
    /// Attenuation of the basis materials.
    pub attenuation: Vec<[f32; LANES]>,
    /// Compton and Rayleigh scattering in all directions by material, mm⁻¹ per g/cm³.
    pub scattered: Vec<f64>,
    /// The same including the emission of K x-rays.
    pub secondary: Vec<f64>,
}

impl Lines {
    /// Selects the energies for the given `accuracy`.
    pub fn new(
        exposure: &Exposure,
        paths: &Paths,
        densities: &[ScatterDensities],
        accuracy: Accuracy,
    ) -> Self {
        let transport = &exposure.transport;
        let line = |energy_kev: f64| {
            let node = transport.tables.attenuation.locate(energy_kev);
            let coefficients =
                |material: usize| transport.tables.attenuation.at(material as u8, node);
            Line {
                energy_kev,
                attenuation: paths.basis.at(energy_kev),
                scattered: (0..densities.len())
                    .map(coefficients)
                    .map(|c| f64::from(c.total - c.photoelectric))
                    .collect(),
                secondary: (0..densities.len())
                    .map(|material| {
                        let samplers = &transport.tables.samplers;
                        secondary(&samplers[material], energy_kev, &coefficients(material))
                    })
                    .collect(),
            }
        };
        let spectra = compressed(exposure, accuracy);
        let scattering = |material: usize| {
            let tables: Vec<ScatterTable> = spectra
                .energy_kev
                .iter()
                .map(|&energy_kev| {
                    let node = transport.tables.attenuation.locate(energy_kev);
                    let c = transport.tables.attenuation.at(material as u8, node);
                    let tables = &transport.tables.samplers[material];
                    ScatterTable::new(&densities[material], tables, energy_kev, &c)
                })
                .collect();
            LineScattering::new(&tables)
        };
        let scattering = (0..densities.len())
            .into_par_iter()
            .map(scattering)
            .collect();
        Self {
            lines: spectra.energy_kev.iter().map(|&kev| line(kev)).collect(),
            scattering,
            attenuation: paths.basis.by_line(&spectra.energy_kev),
            spectra,
        }
    }

    /// Energies of the lines, ascending.
    pub fn energies_kev(&self) -> &[f64] {
        &self.spectra.energy_kev
    }

    /// Scattering of a material at every line.
    pub fn scattering(&self, material: u8) -> &LineScattering {
        &self.scattering[usize::from(material)]
    }

    /// Attenuation of every basis material, mm⁻¹ per g/cm³, line by line, padded to a multiple of
    /// [`WIDTH`](crate::vector_math::WIDTH).
    pub fn attenuation(&self) -> &[Vec<f32>] {
        &self.attenuation
    }

    /// Number of lines with padding.
    pub fn padded(&self) -> usize {
        self.lines.len().next_multiple_of(WIDTH)
    }

    pub fn all(&self) -> &[Line] {
        &self.lines
    }

    /// Every line with its photons in a mixture.
    #[inline]
    pub fn of(&self, mixture: Mixture) -> impl Iterator<Item = (&Line, f64)> {
        self.lines.iter().zip(self.spectra.mixed(mixture))
    }

    /// Every line with its photons near the middle of the field.
    pub fn central_spectrum(&self) -> impl Iterator<Item = (&Line, f64)> {
        let middle = &self.spectra.weights[self.spectra.weights.len() / 2];
        self.lines.iter().zip(middle.iter().copied())
    }
}

/// Coefficient of interactions after which a photon continues: Compton scattering, Rayleigh scattering, and absorption followed by a
/// K x-ray; mm⁻¹ per g/cm³.
#[inline]
pub(crate) fn secondary(tables: &MaterialTables, energy_kev: f64, c: &Coefficients) -> f64 {
    let emitted: f64 = tables.k_lines(energy_kev).map(|(_, share)| share).sum();
    f64::from(c.total - c.photoelectric) + f64::from(c.photoelectric) * emitted
}
