//! One material prepared for transport: cross sections without logarithms, and the scattering samplers.

use crate::{
    compton::Compton,
    cross_sections::{CrossSections, HC_KEV_ANGSTROM, MAX_ENERGY_KEV, MIN_ENERGY_KEV},
    material::Material,
    octaves::Octaves,
    philox::Philox,
    rayleigh::Rayleigh,
};

/// Bins per octave of energy, as a power of two: straight lines in E are then within 1e-4 of E⁻³ laws.
const ENERGY_BITS: u32 = 8;
/// Bins per octave of q², as a power of two.
const Q_SQUARED_BITS: u32 = 5;
/// Smallest q² node in 1/Å²: below it F² and S are linear in q².
const MIN_Q_SQUARED: f64 = 1e-5;

/// Cross sections and samplers of one material for photons of 1 to 150 keV.
#[derive(Clone, Debug)]
pub struct MaterialTables {
    material: Material,
    grid: Octaves,
    bins: Vec<Bin>,
    rayleigh: Rayleigh,
    compton: Compton,
}

/// Cross sections at the lower end of an energy bin and their change across it, cm²/g.
#[derive(Clone, Copy, Debug)]
struct Bin {
    photoelectric: [f32; 2],
    rayleigh: [f32; 2],
    compton: [f32; 2],
}

impl Bin {
    /// Marks a bin that an absorption edge cuts: there the material itself is asked.
    const CUT: f32 = f32::NAN;

    fn new(low: CrossSections, high: CrossSections) -> Self {
        let line = |low: f64, high: f64| [low as f32, (high - low) as f32];
        Self {
            photoelectric: line(low.photoelectric, high.photoelectric),
            rayleigh: line(low.rayleigh, high.rayleigh),
            compton: line(low.compton, high.compton),
        }
    }
}

impl MaterialTables {
    /// Prepares a material.
    #[must_use]
    pub fn new(material: &Material) -> Self {
        let grid = Octaves::covering(MIN_ENERGY_KEV, MAX_ENERGY_KEV, ENERGY_BITS);
        let mut low = material.cross_sections_unchecked(grid.first());
        let mut bins: Vec<Bin> = (0..grid.bins())
            .map(|index| {
                let high = material.cross_sections_unchecked(grid.node(index + 1));
                let bin = Bin::new(low, high);
                low = high;
                bin
            })
            .collect();
        for edge in material.edges_kev() {
            bins[grid.locate(edge).0].photoelectric = [Bin::CUT; 2];
        }
        let q_squared = Octaves::covering(
            MIN_Q_SQUARED,
            (MAX_ENERGY_KEV / HC_KEV_ANGSTROM).powi(2),
            Q_SQUARED_BITS,
        );
        Self {
            grid,
            bins,
            rayleigh: Rayleigh::new(material, q_squared),
            compton: Compton::new(material, q_squared),
            material: material.clone(),
        }
    }

    /// The material that was prepared.
    #[must_use]
    pub fn material(&self) -> &Material {
        &self.material
    }

    /// Mass attenuation by interaction in cm²/g, within 0.1 % of [`Material::cross_sections`].
    ///
    /// Energies outside 1 to 150 keV get the values at the nearer end.
    #[inline]
    #[must_use]
    pub fn cross_sections(&self, energy_kev: f64) -> CrossSections {
        let (index, fraction) = self.grid.locate(energy_kev);
        let bin = &self.bins[index];
        if bin.photoelectric[0].is_nan() {
            return self.beside_an_edge(energy_kev);
        }
        let at = |[low, change]: [f32; 2]| f64::from(low) + f64::from(change) * fraction;
        CrossSections {
            photoelectric: at(bin.photoelectric),
            rayleigh: at(bin.rayleigh),
            compton: at(bin.compton),
        }
    }

    #[cold]
    fn beside_an_edge(&self, energy_kev: f64) -> CrossSections {
        self.material
            .cross_sections_unchecked(energy_kev.clamp(MIN_ENERGY_KEV, MAX_ENERGY_KEV))
    }

    /// Cosine of a Rayleigh scattering angle.
    #[inline]
    pub(crate) fn sample_rayleigh(&self, energy_kev: f64, random: &mut Philox) -> f64 {
        self.rayleigh.sample(energy_kev, random)
    }

    /// Cosine of a Compton scattering angle and the energy of the scattered photon in keV.
    #[inline]
    pub(crate) fn sample_compton(&self, energy_kev: f64, random: &mut Philox) -> (f64, f64) {
        self.compton.sample(energy_kev, random)
    }
}
