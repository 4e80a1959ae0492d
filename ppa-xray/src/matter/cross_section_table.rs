//! Cross sections of one material, evaluated without logarithms.

use crate::matter::cross_sections::CrossSections;
use crate::matter::energy_nodes::{PARTS, energy_bins};
use crate::matter::material::Material;
use crate::octaves::Octaves;

/// Largest relative deviation from a straight line in a bin; bins above it are evaluated from the material itself.
const STRAIGHT: f64 = 5e-4;

/// Mass attenuation by interaction over energy, piecewise linear.
#[derive(Clone, Debug)]
pub(crate) struct CrossSectionTable {
    grid: Octaves,
    bins: Vec<Bin>,
}

/// Cross sections at the lower end of an energy bin and their change across it, cm²/g.
#[derive(Clone, Copy, Debug)]
struct Bin {
    photoelectric: [f32; 2],
    rayleigh: [f32; 2],
    compton: [f32; 2],
}

impl Bin {
    /// Marks a bin in which the photoelectric part is not a straight line, because of an edge or the fine structure
    /// below one; there the material itself is evaluated.
    const CUT: f32 = f32::NAN;

    fn new(low: CrossSections, high: CrossSections) -> Self {
        let line = |low: f64, high: f64| [low as f32, (high - low) as f32];
        Self {
            photoelectric: line(low.photoelectric, high.photoelectric),
            rayleigh: line(low.rayleigh, high.rayleigh),
            compton: line(low.compton, high.compton),
        }
    }

    #[inline]
    fn at(&self, fraction: f64) -> CrossSections {
        let line = |[low, change]: [f32; 2]| f64::from(low) + f64::from(change) * fraction;
        CrossSections {
            photoelectric: line(self.photoelectric),
            rayleigh: line(self.rayleigh),
            compton: line(self.compton),
        }
    }
}

impl CrossSectionTable {
    pub fn new(material: &Material) -> Self {
        let grid = energy_bins();
        let nodes = material.cross_sections_at_nodes();
        let mut bins: Vec<Bin> = nodes
            .windows(PARTS + 1)
            .step_by(PARTS)
            .map(|sections| {
                let mut bin = Bin::new(sections[0], sections[PARTS]);
                let bent = (1..PARTS).any(|part| {
                    let line = bin.at(part as f64 / PARTS as f64).photoelectric;
                    (line / sections[part].photoelectric - 1.0).abs() > STRAIGHT
                });
                if bent {
                    bin.photoelectric = [Bin::CUT; 2];
                }
                bin
            })
            .collect();
        for edge in material.edges_kev() {
            bins[grid.locate(edge).0].photoelectric = [Bin::CUT; 2];
        }
        Self { grid, bins }
    }

    /// Interpolated cross sections, or `None` in a bin that is not a straight line. Energies outside get the values at the nearer end.
    #[inline]
    pub fn at(&self, energy_kev: f64) -> Option<CrossSections> {
        let (index, fraction) = self.grid.locate(energy_kev);
        let bin = &self.bins[index];
        (!bin.photoelectric[0].is_nan()).then(|| bin.at(fraction))
    }
}
