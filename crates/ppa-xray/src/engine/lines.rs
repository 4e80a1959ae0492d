//! The energies that stand for the spectrum, and what the materials do to them.

use rayon::prelude::*;

use crate::engine::attenuation_basis::LANES;
use crate::engine::paths::Paths;
use crate::engine::scatter_table::ScatterTable;
use crate::engine::spectral_quadrature::SpectralQuadrature;
use crate::matter::scatter_density::ScatterDensities;
use crate::transport::tracking::Transport;

/// Energies of a quadrature for each spectrum of the emitter.
pub(crate) struct Lines {
    spectra: Vec<Vec<Line>>,
}

/// An energy of a quadrature.
pub(crate) struct Line {
    pub energy_kev: f64,
    pub photons: f64,
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
        transport: &Transport,
        paths: &Paths,
        densities: &[ScatterDensities],
        nodes: usize,
    ) -> Self {
        let line = |energy_kev: f64, photons: f64| {
            let node = transport.attenuation.locate(energy_kev);
            let coefficients = |material: usize| transport.attenuation.at(material as u8, node);
            let table = |material: usize| {
                let tables = &transport.samplers[material];
                let c = coefficients(material);
                ScatterTable::new(&densities[material], tables, energy_kev, &c)
            };
            Line {
                energy_kev,
                photons,
                attenuation: paths.basis.at(energy_kev),
                scattering: (0..densities.len()).into_par_iter().map(table).collect(),
                scattered: (0..densities.len())
                    .map(coefficients)
                    .map(|c| f64::from(c.total - c.photoelectric))
                    .collect(),
            }
        };
        Self {
            spectra: SpectralQuadrature::compressed(transport, nodes)
                .iter()
                .map(|quadrature| {
                    let lines = quadrature.energy_kev.iter().zip(&quadrature.photons);
                    lines.map(|(&e, &photons)| line(e, photons)).collect()
                })
                .collect(),
        }
    }

    /// Lines of one spectrum.
    pub fn of(&self, spectrum: usize) -> &[Line] {
        &self.spectra[spectrum]
    }

    /// Lines of the spectrum in the middle of the field, more or less.
    pub fn usual(&self) -> &[Line] {
        self.of(self.spectra.len() / 2)
    }

    /// Lines of a spectrum and of the next one, if there is one: those that a mixture may have.
    pub fn of_mixture(&self, lower: usize) -> impl Iterator<Item = &Line> {
        let end = (lower + 2).min(self.spectra.len());
        self.spectra[lower..end].iter().flatten()
    }

    /// Most lines of a mixture.
    pub fn most(&self) -> usize {
        (0..self.spectra.len())
            .map(|lower| self.of_mixture(lower).count())
            .max()
            .unwrap_or(0)
    }
}
