//! Energies of the quadrature over the spectrum, with attenuation and scattering of every material at each.

use rayon::prelude::*;

use crate::beam::heel::Mixture;
use crate::beam::spectral_lines::SpectralLines;
use crate::engine::attenuation_basis::LANES;
use crate::engine::exposure::Exposure;
use crate::engine::paths::Paths;
use crate::engine::scatter_table::ScatterTable;
use crate::engine::spectral_quadrature::compressed;
use crate::matter::scatter_density::ScatterDensities;

/// Energies of a quadrature, the same for all spectra of the emitter.
pub(crate) struct Lines {
    lines: Vec<Line>,
    spectra: SpectralLines,
}

/// An energy of a quadrature.
pub(crate) struct Line {
    pub energy_kev: f64,
    /// Attenuation of the basis materials.
    pub attenuation: Vec<[f32; LANES]>,
    /// By material.
    pub scattering: Vec<ScatterTable>,
    /// Compton and Rayleigh scattering in all directions by material, mm⁻¹ per g/cm³.
    pub scattered: Vec<f64>,
}

impl Lines {
    /// At most `nodes` energies between two absorption edges.
    pub fn new(
        exposure: &Exposure,
        paths: &Paths,
        densities: &[ScatterDensities],
        nodes: usize,
    ) -> Self {
        let transport = &exposure.transport;
        let line = |energy_kev: f64| {
            let node = transport.attenuation.locate(energy_kev);
            let coefficients = |material: usize| transport.attenuation.at(material as u8, node);
            let table = |material: usize| {
                let tables = &transport.samplers[material];
                let c = coefficients(material);
                ScatterTable::new(&densities[material], tables, energy_kev, &c)
            };
            Line {
                energy_kev,
                attenuation: paths.basis.at(energy_kev),
                scattering: (0..densities.len()).into_par_iter().map(table).collect(),
                scattered: (0..densities.len())
                    .map(coefficients)
                    .map(|c| f64::from(c.total - c.photoelectric))
                    .collect(),
            }
        };
        let spectra = compressed(exposure, nodes);
        Self {
            lines: spectra.energy_kev.iter().map(|&kev| line(kev)).collect(),
            spectra,
        }
    }

    pub fn all(&self) -> &[Line] {
        &self.lines
    }

    /// Every line with its photons in a mixture.
    #[inline]
    pub fn of(&self, mixture: Mixture) -> impl Iterator<Item = (&Line, f64)> {
        self.lines.iter().zip(self.spectra.mixed(mixture))
    }

    /// Every line with its photons in the middle of the field, more or less.
    pub fn usual(&self) -> impl Iterator<Item = (&Line, f64)> {
        let middle = &self.spectra.weights[self.spectra.weights.len() / 2];
        self.lines.iter().zip(middle.iter().copied())
    }
}
