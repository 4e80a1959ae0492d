//! Tungsten-anode x-ray tube: unfiltered spectra from a table, filtered by the cross sections of this crate.
//!
//! The table is made by `scripts/make_spectra.py` from SpekPy 2.5.4 and separates bremsstrahlung from characteristic lines;
//! see `data/README.md`.

use std::sync::OnceLock;

use crate::{
    beam::spectrum::Spectrum, beam::spectrum_error::SpectrumError,
    matter::cross_sections::Unpacked, matter::material::Material,
};

/// A line grows as (U − 1)^1.63, U = kVp over its edge (Green & Cosslett 1968, doi:10.1088/0022-3727/1/4/302).
const LINE_EXPONENT: f64 = 1.63;

/// A layer in the beam.
#[derive(Clone, Debug, PartialEq)]
pub struct Filter {
    /// Material, at its nominal density.
    pub material: Material,
    /// Thickness along the beam in mm.
    pub mm: f64,
}

impl Filter {
    /// Fraction of photons of one energy that pass the filter without interacting.
    fn transmission(&self, energy_kev: f64) -> Result<f64, SpectrumError> {
        let mu_per_cm = self.material.total_cm2_g(energy_kev)? * self.material.density_g_cm3();
        Ok((-mu_per_cm * self.mm / 10.0).exp())
    }
}

impl std::str::FromStr for Filter {
    type Err = SpectrumError;

    /// Parses text such as `Al:2.5`: a material of the library or an element symbol, and a thickness in millimetres.
    fn from_str(text: &str) -> Result<Self, SpectrumError> {
        let syntax = || SpectrumError::FilterSyntax {
            found: text.to_owned(),
        };
        let (material, mm) = text.split_once(':').ok_or_else(syntax)?;
        let mm = mm.trim().parse().map_err(|_| syntax())?;
        Ok(Self {
            material: Material::named(material.trim())?,
            mm,
        })
    }
}

/// A tungsten-anode tube and the filters of its beam.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct TubeSpec {
    /// Tube voltage in kV, constant potential.
    pub kvp: f64,
    /// Angle between the anode's face and the central beam in degrees.
    pub anode_angle_deg: f64,
    /// Layers in the beam, air included if it matters; any order.
    pub filters: Vec<Filter>,
}

impl TubeSpec {
    /// A tube of `kvp` kV with its anode face at `anode_angle_deg` from the central beam, behind `filters`.
    pub const fn new(kvp: f64, anode_angle_deg: f64, filters: Vec<Filter>) -> Self {
        Self {
            kvp,
            anode_angle_deg,
            filters,
        }
    }
}

impl Spectrum {
    /// Spectrum of a tungsten-anode tube on its central axis, in bins of 0.5 keV, with its absolute fluence.
    ///
    /// Unfiltered spectra interpolate those of SpekPy 2.5.4 (model `casim`; Omar, Andreo, Poludniowski 2020,
    /// doi:10.1002/mp.14332) in voltage and angle; filters attenuate by the cross sections of this crate, narrow beam.
    /// The fluence is that at 1 m. It is attenuated by the air in between only if `filters` includes an air filter.
    ///
    /// # Errors
    /// A voltage outside 40 to 150 kV, an angle outside 1° to 30°, a filter whose thickness is negative or not finite,
    /// filters that let nothing through.
    pub fn tungsten(tube: &TubeSpec) -> Result<Self, SpectrumError> {
        for filter in &tube.filters {
            if !(filter.mm.is_finite() && filter.mm >= 0.0) {
                return Err(SpectrumError::FilterThickness {
                    material: filter.material.name().to_owned(),
                    found_mm: filter.mm,
                });
            }
        }
        let table = table();
        let at = table.weights(tube.kvp, tube.anode_angle_deg)?;
        let transmission = |energy_kev| {
            tube.filters.iter().try_fold(1.0, |product, filter| {
                Ok::<_, SpectrumError>(product * filter.transmission(energy_kev)?)
            })
        };
        let bin_of = |energy_kev: f64| ((energy_kev - table.low_kev) / table.width_kev).floor();
        let edge = |bin: usize| (table.low_kev + table.width_kev * bin as f64).min(tube.kvp);
        let bins = ((tube.kvp - table.low_kev) / table.width_kev).ceil() as usize;
        let edges: Vec<f64> = (0..=bins).map(edge).collect();
        let mut photons = Vec::with_capacity(bins);
        for (bin, edges) in edges.windows(2).enumerate() {
            let energy_kev = 0.5 * (edges[0] + edges[1]);
            let per_kev = (tube.kvp - energy_kev) * at.interpolate(|row| row.ln_brem[bin]).exp();
            photons.push(per_kev * (edges[1] - edges[0]) * transmission(energy_kev)?);
        }
        for (index, line) in table.lines.iter().enumerate() {
            if tube.kvp > line.edge_kev && line.energy_kev < tube.kvp {
                let overvoltage = (tube.kvp / line.edge_kev - 1.0).powf(LINE_EXPONENT);
                let emitted = overvoltage * at.interpolate(|row| row.lines[index]);
                photons[bin_of(line.energy_kev) as usize] +=
                    emitted * transmission(line.energy_kev)?;
            }
        }
        Ok(Self::from_bins(&edges, &photons)?.of_tube(tube, photons.iter().sum()))
    }
}

struct Line {
    energy_kev: f64,
    edge_kev: f64,
}

/// Unfiltered photons per mAs and cm² at 1 m, at one voltage and angle.
struct Row {
    /// ln of photons per keV over (kVp − E), by bin.
    ln_brem: Vec<f64>,
    /// Photons of each line over (U − 1)^1.63.
    lines: Vec<f64>,
}

struct Table {
    low_kev: f64,
    width_kev: f64,
    voltages: Vec<f64>,
    angles: Vec<f64>,
    lines: Vec<Line>,
    /// Rows sorted by voltage, then by angle.
    rows: Vec<Row>,
}

/// The four rows around a voltage and an angle, with their weights.
struct Weights<'a>([(f64, &'a Row); 4]);

impl Weights<'_> {
    fn interpolate(&self, value: impl Fn(&Row) -> f64) -> f64 {
        self.0.iter().map(|(weight, row)| weight * value(row)).sum()
    }
}

impl Table {
    fn weights(&self, kvp: f64, angle_deg: f64) -> Result<Weights<'_>, SpectrumError> {
        let [min, max] = ends(&self.voltages);
        if !(min..=max).contains(&kvp) {
            return Err(SpectrumError::TubeVoltage {
                found: kvp,
                min,
                max,
            });
        }
        let [min, max] = ends(&self.angles);
        if !(min..=max).contains(&angle_deg) {
            return Err(SpectrumError::AnodeAngle {
                found: angle_deg,
                min,
                max,
            });
        }
        let (v, t) = bracket(&self.voltages, kvp);
        let (a, s) = bracket(&self.angles, angle_deg);
        let row = |v: usize, a: usize| &self.rows[v * self.angles.len() + a];
        Ok(Weights([
            ((1.0 - t) * (1.0 - s), row(v, a)),
            ((1.0 - t) * s, row(v, a + 1)),
            (t * (1.0 - s), row(v + 1, a)),
            (t * s, row(v + 1, a + 1)),
        ]))
    }
}

/// Anode angles of the tube model, lowest and highest, degrees.
pub(crate) fn anode_angles_deg() -> [f64; 2] {
    ends(&table().angles)
}

fn ends(nodes: &[f64]) -> [f64; 2] {
    [nodes[0], nodes[nodes.len() - 1]]
}

/// Interval of ascending `nodes` that contains `x`, and the fraction of the interval below `x` on a logarithmic scale.
fn bracket(nodes: &[f64], x: f64) -> (usize, f64) {
    let lower = nodes
        .partition_point(|&node| node <= x)
        .clamp(1, nodes.len() - 1)
        - 1;
    (
        lower,
        (x / nodes[lower]).ln() / (nodes[lower + 1] / nodes[lower]).ln(),
    )
}

fn table() -> &'static Table {
    static TABLE: OnceLock<Table> = OnceLock::new();
    TABLE.get_or_init(|| {
        let mut data = Unpacked::new(include_bytes!("../../data/tungsten.bin.deflate"));
        let [n_voltages, n_angles, n_bins, n_lines] = std::array::from_fn(|_| data.count());
        let grid = data.doubles(2);
        let (voltages, angles) = (data.doubles(n_voltages), data.doubles(n_angles));
        let energies = data.doubles(n_lines);
        let lines = energies.into_iter().zip(data.doubles(n_lines));
        let lines = lines
            .map(|(energy_kev, edge_kev)| Line {
                energy_kev,
                edge_kev,
            })
            .collect();
        let brem: Vec<Vec<f64>> = (0..n_voltages * n_angles)
            .map(|_| data.doubles(n_bins))
            .collect();
        let rows = brem
            .into_iter()
            .map(|ln_brem| Row {
                ln_brem,
                lines: data.doubles(n_lines),
            })
            .collect();
        Table {
            low_kev: grid[0],
            width_kev: grid[1],
            voltages,
            angles,
            lines,
            rows,
        }
    })
}
