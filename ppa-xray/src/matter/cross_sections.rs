//! Embedded cross sections of the elements: photoelectric, Rayleigh and Compton, F(q) and S(q), and their electron shells.
//!
//! Made by `scripts/make_cross_sections.py` from xraylib 4.3.0 (EPDL97); see `data/README.md`.

use std::{io::Read, ops::Add, sync::OnceLock};

use crate::matter::{
    electron_shell::Shell, energy_nodes::energy_nodes, fluorescence::KFluorescence,
};

/// Planck's constant times the speed of light in keV Å: q = sin(θ/2) E / hc in 1/Å.
pub(crate) const HC_KEV_ANGSTROM: f64 = 12.398_419_843_320_026;
/// Rest energy of the electron in keV (CODATA 2018).
pub(crate) const ELECTRON_REST_KEV: f64 = 510.998_95;

/// Mass attenuation by interaction in cm²/g.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CrossSections {
    /// Absorption by the photoelectric effect.
    pub photoelectric: f64,
    /// Elastic scattering off bound electrons.
    pub rayleigh: f64,
    /// Inelastic scattering.
    pub compton: f64,
}

impl CrossSections {
    /// Sum of the three in cm²/g.
    #[inline]
    #[must_use]
    pub fn total(&self) -> f64 {
        self.photoelectric + self.rayleigh + self.compton
    }

    pub(crate) fn scaled(self, factor: f64) -> Self {
        Self {
            photoelectric: self.photoelectric * factor,
            rayleigh: self.rayleigh * factor,
            compton: self.compton * factor,
        }
    }
}

impl Add for CrossSections {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self {
            photoelectric: self.photoelectric + other.photoelectric,
            rayleigh: self.rayleigh + other.rayleigh,
            compton: self.compton + other.compton,
        }
    }
}

/// Log-log interpolation between nodes. A repeated abscissa is an edge, at which the upper side applies.
#[derive(Debug, PartialEq)]
pub(crate) struct LogLog {
    ln_x: Vec<f64>,
    ln_y: Vec<f64>,
}

impl LogLog {
    /// Replaces zero, which has no logarithm.
    const NOTHING: f64 = 1e-99;

    pub(crate) fn new(x: &[f64], y: &[f64]) -> Self {
        Self {
            ln_x: x.iter().map(|x| x.ln()).collect(),
            ln_y: y.iter().map(|y| y.max(Self::NOTHING).ln()).collect(),
        }
    }

    pub(crate) fn at(&self, ln_x: f64) -> f64 {
        let upper = self
            .ln_x
            .partition_point(|&node| node <= ln_x)
            .clamp(1, self.ln_x.len() - 1);
        let (x0, x1) = (self.ln_x[upper - 1], self.ln_x[upper]);
        let (y0, y1) = (self.ln_y[upper - 1], self.ln_y[upper]);
        (y0 + (y1 - y0) * (ln_x - x0) / (x1 - x0)).exp()
    }

    /// Abscissae that occur twice.
    pub(crate) fn edges(&self) -> impl Iterator<Item = f64> {
        self.ln_x
            .windows(2)
            .filter(|pair| pair[0] == pair[1])
            .map(|pair| pair[0].exp())
    }
}

/// Cross sections over energy.
#[derive(Debug, PartialEq)]
pub(crate) struct SectionTables {
    pub photoelectric: LogLog,
    pub rayleigh: LogLog,
    pub compton: LogLog,
}

impl SectionTables {
    pub fn at(&self, energy_kev: f64) -> CrossSections {
        let ln_e = energy_kev.ln();
        CrossSections {
            photoelectric: self.photoelectric.at(ln_e),
            rayleigh: self.rayleigh.at(ln_e),
            compton: self.compton.at(ln_e),
        }
    }
}

/// Tables of one element.
pub(crate) struct Element {
    /// Atomic weight in g/mol.
    pub(crate) atomic_weight: f64,
    sections: SectionTables,
    /// `sections` at [`energy_nodes`], computed on first use.
    at_nodes: OnceLock<Vec<CrossSections>>,
    form_factor: Vec<f64>,
    incoherent: Vec<f64>,
    shells: Vec<Shell>,
    k_fluorescence: Option<KFluorescence>,
}

impl Element {
    /// Mass attenuation at an energy inside the tables.
    pub(crate) fn cross_sections(&self, energy_kev: f64) -> CrossSections {
        self.sections.at(energy_kev)
    }

    /// [`Element::cross_sections`] at [`energy_nodes`], computed once: all materials are sums of them.
    pub(crate) fn cross_sections_at_nodes(&self) -> &[CrossSections] {
        self.at_nodes
            .get_or_init(|| energy_nodes().map(|e| self.cross_sections(e)).collect())
    }

    /// Absorption edges inside the tables, keV, ascending.
    pub(crate) fn edges_kev(&self) -> impl Iterator<Item = f64> {
        self.sections.photoelectric.edges()
    }

    /// Electrons, binding energies and Compton profiles; the electrons add up to Z.
    pub(crate) fn shells(&self) -> &[Shell] {
        &self.shells
    }

    /// K fluorescence, if the K edge is above 1 keV.
    pub(crate) fn k_fluorescence(&self) -> Option<&KFluorescence> {
        self.k_fluorescence.as_ref()
    }

    /// Form factor F(q), F(0) = Z; q = sin(θ/2)/λ in 1/Å.
    pub(crate) fn form_factor(&self, q: f64) -> f64 {
        scattering_factor(&elements().q, &self.form_factor, q)
    }

    /// Incoherent scattering function S(q), from 0 at q = 0 to nearly Z.
    pub(crate) fn incoherent(&self, q: f64) -> f64 {
        scattering_factor(&elements().q, &self.incoherent, q)
    }
}

/// Interpolates log-log between positive nodes and linearly from q = 0 to the first of them.
fn scattering_factor(nodes: &[f64], values: &[f64], q: f64) -> f64 {
    let upper = nodes
        .partition_point(|&node| node <= q)
        .clamp(1, nodes.len() - 1);
    let (q0, q1) = (nodes[upper - 1], nodes[upper]);
    let (f0, f1) = (values[upper - 1], values[upper]);
    if upper == 1 {
        f0 + (f1 - f0) * q / q1
    } else {
        f0 * (f1 / f0).powf((q / q0).ln() / (q1 / q0).ln())
    }
}

/// All elements by atomic number less one, and the common grid of F and S.
pub(crate) struct Elements {
    q: Vec<f64>,
    by_z: Vec<Element>,
}

impl Elements {
    /// The element of atomic number `z`, if it is in the tables (Z = 1 to 92).
    pub(crate) fn get(&self, z: u8) -> Option<&Element> {
        self.by_z.get(usize::from(z).checked_sub(1)?)
    }
}

/// Returns the embedded tables, unpacked once.
pub(crate) fn elements() -> &'static Elements {
    static ELEMENTS: OnceLock<Elements> = OnceLock::new();
    ELEMENTS.get_or_init(|| {
        let mut data = Unpacked::new(include_bytes!("../../data/elements.bin.deflate"));
        let [n_elements, n_energy, n_q] = std::array::from_fn(|_| data.count());
        let energies = data.doubles(n_energy);
        let q = data.doubles(n_q);
        let by_z = (0..n_elements)
            .map(|_| {
                let atomic_weight = f64::from(data.floats(1)[0]);
                let n_photo = data.count();
                let photo_energies = data.doubles(n_photo);
                Element {
                    atomic_weight,
                    sections: SectionTables {
                        photoelectric: LogLog::new(&photo_energies, &data.doubles(n_photo)),
                        rayleigh: LogLog::new(&energies, &data.doubles(n_energy)),
                        compton: LogLog::new(&energies, &data.doubles(n_energy)),
                    },
                    at_nodes: OnceLock::new(),
                    form_factor: data.doubles(n_q),
                    incoherent: data.doubles(n_q),
                    shells: {
                        let n_shells = data.count();
                        let numbers = data.doubles(3 * n_shells);
                        let shells = numbers.chunks_exact(3).map(|shell| Shell {
                            electrons: shell[0],
                            binding_kev: shell[1],
                            profile_at_zero: shell[2],
                        });
                        shells.collect()
                    },
                    k_fluorescence: KFluorescence::from_table(&data.doubles(11)),
                }
            })
            .collect();
        Elements { q, by_z }
    })
}

/// Reads an embedded, deflated table of little-endian numbers.
///
/// The tables are part of the program: a table that does not parse is a bug and causes a panic.
pub(crate) struct Unpacked {
    bytes: Vec<u8>,
    position: usize,
}

impl Unpacked {
    pub(crate) fn new(deflated: &[u8]) -> Self {
        let mut bytes = Vec::new();
        flate2::read::DeflateDecoder::new(deflated)
            .read_to_end(&mut bytes)
            .expect("embedded table inflates");
        Self { bytes, position: 0 }
    }

    fn word(&mut self) -> [u8; 4] {
        let word = self.bytes[self.position..self.position + 4]
            .try_into()
            .expect("four bytes");
        self.position += 4;
        word
    }

    pub(crate) fn count(&mut self) -> usize {
        u32::from_le_bytes(self.word()) as usize
    }

    pub(crate) fn floats(&mut self, n: usize) -> Vec<f32> {
        (0..n).map(|_| f32::from_le_bytes(self.word())).collect()
    }

    pub(crate) fn doubles(&mut self, n: usize) -> Vec<f64> {
        self.floats(n).into_iter().map(f64::from).collect()
    }
}
