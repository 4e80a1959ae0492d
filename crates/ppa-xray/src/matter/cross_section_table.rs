//! Cross sections of one material without logarithms.

use crate::matter::cross_sections::{CrossSections, MAX_ENERGY_KEV, MIN_ENERGY_KEV};
use crate::matter::material::Material;
use crate::octaves::Octaves;

/// Bins per octave of energy, as a power of two: straight lines in E are then within 1e-4 of E⁻³ laws.
const ENERGY_BITS: u32 = 8;
/// Largest relative departure from a straight line in a bin; beyond it the material itself is to be asked.
const STRAIGHT: f64 = 5e-4;

/// Mass attenuation by interaction over energy, in straight lines.
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
    /// Marks a bin in which the photoelectric part is no straight line, because of an edge or the fine structure
    /// below one: there the material itself is asked.
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
        let grid = Octaves::covering(MIN_ENERGY_KEV, MAX_ENERGY_KEV, ENERGY_BITS);
        let mut low = material.cross_sections_unchecked(grid.first());
        let mut bins: Vec<Bin> = (0..grid.bins())
            .map(|index| {
                let high = material.cross_sections_unchecked(grid.node(index + 1));
                let mut bin = Bin::new(low, high);
                let width = grid.node(index + 1) - grid.node(index);
                let bent = [0.25, 0.5, 0.75].into_iter().any(|fraction| {
                    let direct =
                        material.cross_sections_unchecked(grid.node(index) + fraction * width);
                    (bin.at(fraction).photoelectric / direct.photoelectric - 1.0).abs() > STRAIGHT
                });
                if bent {
                    bin.photoelectric = [Bin::CUT; 2];
                }
                low = high;
                bin
            })
            .collect();
        for edge in material.edges_kev() {
            bins[grid.locate(edge).0].photoelectric = [Bin::CUT; 2];
        }
        Self { grid, bins }
    }

    /// Nothing in a bin that is no straight line; energies outside get the values at the nearer end.
    #[inline]
    pub fn at(&self, energy_kev: f64) -> Option<CrossSections> {
        let (index, fraction) = self.grid.locate(energy_kev);
        let bin = &self.bins[index];
        (!bin.photoelectric[0].is_nan()).then(|| bin.at(fraction))
    }
}
