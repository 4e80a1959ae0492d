//! Material files of MC-GPU v1.3 (`.mcgpu`, `.mcgpu.gz`).

use std::path::Path;

use crate::matter::electron_shell::{ATOMIC_MOMENTA_PER_MC, Shell};
use crate::matter::material::Material;
use crate::matter::photon_tables::PhotonTables;
use crate::mcgpu::error::McgpuError;
use crate::mcgpu::material_lines::MaterialFile;
use crate::mcgpu::rational_inverse::density_in_interval;

/// Largest number of energies in a file; MC-GPU itself stops at 25005.
const MOST_ENERGIES: usize = 200_000;

/// Largest number of nodes of the form factor, and of shells.
const MOST_NODES: usize = 10_000;

/// Squared momentum transfer, 1/Å², beyond that of any photon below 150 keV, which is (150 keV / hc)².
const LARGEST_X: f64 = 146.5;

/// Reads a material: mean free paths, squared molecular form factor, shells with their Compton profiles.
///
/// The mean free paths are scaled by the densities of the voxels; the density in the file is nominal. The form factor is the
/// derivative of the rational inverse cumulative distribution that MC-GPU samples. The table that speeds up its search (ITL,
/// ITU) and the largest cumulative probability of each energy follow from the rest and are ignored.
///
/// # Errors
/// [`McgpuError`] naming the line, what was found and what was expected, or mean free paths that contradict their total.
pub fn read_material(path: impl AsRef<Path>) -> Result<Material, McgpuError> {
    let mut file = MaterialFile::open(path.as_ref())?;
    let name = file.name()?;
    let density_g_cm3 = file.nominal_density()?;
    let mut tables = PhotonTables {
        density_g_cm3,
        energies_kev: Vec::new(),
        photoelectric_cm2_g: Vec::new(),
        compton_cm2_g: Vec::new(),
        rayleigh_cm2_g: Vec::new(),
        form_factor_squared: Vec::new(),
        shells: Vec::new(),
    };
    file.mean_free_paths(&mut tables)?;
    tables.form_factor_squared = file.form_factor_squared()?;
    tables.shells = file.shells()?;
    Material::from_tables(name, &tables).map_err(|source| McgpuError::Material {
        path: path.as_ref().into(),
        source,
    })
}

impl MaterialFile {
    fn name(&mut self) -> Result<String, McgpuError> {
        self.seek("[MATERIAL NAME")?;
        let line = self.line("the name of the material")?;
        let text = String::from_utf8_lossy(&line);
        Ok(text.trim().trim_start_matches('#').trim().to_owned())
    }

    fn nominal_density(&mut self) -> Result<f64, McgpuError> {
        self.seek("[NOMINAL DENSITY")?;
        self.counted("the nominal density in g/cm³")
    }

    fn mean_free_paths(&mut self, tables: &mut PhotonTables) -> Result<(), McgpuError> {
        self.seek("[NUMBER OF DATA VALUES")?;
        let energies = self.count("energies", 2..=MOST_ENERGIES)?;
        self.seek("[MEAN FREE PATHS")?;
        self.line("the headline of the mean free paths")?;
        let expected = "an energy in eV, above the one before, and the mean free paths for Rayleigh, Compton, photoelectric and all, in cm";
        let mut last_ev = 0.0;
        for _ in 0..energies {
            let [energy_ev, paths_cm @ ..] = self.row(expected, |row: &[f64; 5]| {
                row[0] > last_ev && row.iter().all(|value| *value > 0.0)
            })?;
            let [rayleigh, compton, photoelectric, total] =
                paths_cm.map(|path_cm| 1.0 / (path_cm * tables.density_g_cm3));
            let sum = rayleigh + compton + photoelectric;
            if (sum / total - 1.0).abs().partial_cmp(&0.01) != Some(std::cmp::Ordering::Less) {
                let [.., found] = paths_cm;
                let sum_cm = 1.0 / (sum * tables.density_g_cm3);
                return Err(self.unexpected(
                    format!("{found} cm").as_bytes(),
                    format!(
                        "{sum_cm:.6} cm within 1 %, the mean free path of all interactions together"
                    ),
                ));
            }
            last_ev = energy_ev;
            tables.energies_kev.push(energy_ev / 1000.0);
            tables.rayleigh_cm2_g.push(rayleigh);
            tables.compton_cm2_g.push(compton);
            tables.photoelectric_cm2_g.push(photoelectric);
        }
        Ok(())
    }

    /// Squared form factor over q², in 1/Å².
    fn form_factor_squared(&mut self) -> Result<Vec<[f64; 2]>, McgpuError> {
        self.seek("[DATA VALUES")?;
        let nodes = self.count("form factor nodes", 3..=MOST_NODES)?;
        self.line("the headline of the form factor")?;
        let expected = "q² in 1/Å² and its cumulative probability, both ascending, and two parameters of the interval";
        let mut points = Vec::new();
        let mut before: Option<[f64; 4]> = None;
        for _ in 0..nodes {
            let row = self.row(expected, |&[x, p, a, b]| {
                let first = before.unwrap_or([f64::NEG_INFINITY, 0.0, 0.0, 0.0]);
                x.is_finite()
                    && x >= 0.0
                    && x > first[0]
                    && (first[1]..=1.0 + 1e-6).contains(&p)
                    && 1.0 + a + b > 0.0
                    && b < 1.0
            })?;
            if let Some(start) = before.filter(|[x, ..]| *x < LARGEST_X) {
                points.extend(density_in_interval(start, [row[0], row[1]]));
            }
            before = Some(row);
        }
        Ok(points)
    }

    fn shells(&mut self) -> Result<Vec<Shell>, McgpuError> {
        self.seek("[NUMBER OF SHELLS")?;
        let shells = self.count("shells", 1..=MOST_NODES)?;
        self.line("the headline of the shells")?;
        let expected =
            "electrons, binding energy in eV and Compton profile at zero in 1/(mₑc) of a shell";
        (0..shells)
            .map(|_| {
                let [electrons, binding_ev, profile] = self.row(expected, |row: &[f64; 3]| {
                    row[0] > 0.0
                        && row[1] >= 0.0
                        && row[2] > 0.0
                        && row.iter().all(|v| v.is_finite())
                })?;
                Ok(Shell {
                    electrons,
                    binding_kev: binding_ev / 1000.0,
                    profile_at_zero: profile / ATOMIC_MOMENTA_PER_MC,
                })
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use std::fmt::Write;

    use super::*;
    use crate::mcgpu::mangled;

    /// A file with the cross sections of `material`, F² = 1/(1 + x)² and two shells.
    fn text(material: &Material, energies_kev: &[f64]) -> String {
        let density = material.density_g_cm3();
        let mut text = format!(
            "#[MATERIAL NAME]\n# {}\n#[NOMINAL DENSITY (g/cm^3)]\n#   {density:.8}\n#[NUMBER OF DATA VALUES]\n#  {}\n\
             #[MEAN FREE PATHS (cm)]\n#[Energy (eV) | ...]\n",
            material.name(),
            energies_kev.len(),
        );
        for &energy_kev in energies_kev {
            let sections = material.cross_sections(energy_kev).unwrap();
            let path = |section: f64| 1.0 / (section * density);
            writeln!(
                text,
                "  {:.10E}  {:.10E}  {:.10E}  {:.10E}  {:.10E}  5.0E-01",
                1e3 * energy_kev,
                path(sections.rayleigh),
                path(sections.compton),
                path(sections.photoelectric),
                path(sections.total()),
            )
            .unwrap();
        }
        let nodes: Vec<f64> = (0..60)
            .map(|i| 1e-3 * (f64::from(i) * 0.22).exp_m1())
            .collect();
        let cumulative = |x: f64| x / (1.0 + x);
        writeln!(
            text,
            "#[RAYLEIGH INTERACTIONS]\n#[DATA VALUES TO SAMPLE]\n#    60\n#[X, P, A, B, ITL, ITU]"
        )
        .unwrap();
        let last = nodes[59];
        for (index, &x) in nodes.iter().enumerate() {
            // The parameters for which the density of the interval is F² at both ends.
            let (a, b) = nodes.get(index + 1).map_or((0.0, 0.0), |&next| {
                let slope = (cumulative(next) - cumulative(x)) / (next - x);
                let density = |x: f64| (1.0 + x).powi(-2);
                let b = 1.0 - slope * slope / (density(x) * density(next));
                (slope / density(x) - b - 1.0, b)
            });
            let p = cumulative(x) / cumulative(last);
            writeln!(text, "  {x:.10E}  {p:.10E}  {a:.10E}  {b:.10E}  1  60").unwrap();
        }
        text + "#[COMPTON INTERACTIONS]\n#[NUMBER OF SHELLS]\n#      2\n#[FCO, UICO, FJ0, KZCO, KSCO]\n\
            \x20  0.66666667E+00   0.13600000E+02   0.11634356E+03    1    1\n\
            \x20  0.26666667E+01   0.53200000E+03   0.15485067E+02    8    1\n"
    }

    fn energies() -> Vec<f64> {
        (0..40).map(|i| 5.0 + 3.0 * f64::from(i)).collect()
    }

    fn read(text: &[u8]) -> Result<Material, McgpuError> {
        mangled::read(text, |path| read_material(path))
    }

    #[test]
    fn a_file_gives_its_material_back() {
        let pmma = Material::named("pmma").unwrap();
        let found = read(text(&pmma, &energies()).as_bytes()).unwrap();
        assert_eq!(found.name(), "pmma");
        assert_eq!(found.density_g_cm3(), pmma.density_g_cm3());
        assert_eq!(found.energy_range_kev(), [5.0, 122.0]);
        for energy_kev in energies() {
            let (found, expected) = (
                found.cross_sections(energy_kev).unwrap(),
                pmma.cross_sections(energy_kev).unwrap(),
            );
            for (found, expected) in [
                (found.photoelectric, expected.photoelectric),
                (found.compton, expected.compton),
                (found.rayleigh, expected.rayleigh),
            ] {
                assert!((found / expected - 1.0).abs() < 1e-7);
            }
        }
        // The sampling table reproduces the form factor that it was made from, to the error of interpolation.
        let at_zero = found.form_factor_squared_per_gram(0.0);
        for q in [0.01, 0.1, 0.5, 1.0, 3.0, 12.0] {
            let ratio = found.form_factor_squared_per_gram(q) / at_zero * (1.0 + q * q).powi(2);
            assert!((ratio - 1.0).abs() < 5e-3, "{q}: {ratio}");
        }
        // At large q every electron scatters; near zero only loosely bound ones do.
        let electrons = |q| found.incoherent_per_gram(q) / found.incoherent_per_gram(1e3);
        assert!(electrons(0.5) < 0.5 && electrons(20.0) > 0.99);
    }

    #[test]
    fn mistakes_are_reported_with_their_line() {
        let sample = text(&Material::named("water").unwrap(), &energies());
        let lines: Vec<&str> = sample.lines().collect();
        let report = |line: usize, mended: &str| {
            let mut lines = lines.clone();
            lines[line - 1] = mended;
            match read(lines.join("\n").as_bytes()) {
                Ok(_) => panic!("line {line} → {mended} was read"),
                Err(error) => error.to_string(),
            }
        };
        let long = "  5.0E3 1.8 9.0 0.024 0.0236 0.3";
        assert!(lines[8].starts_with("  5.0"), "{}", lines[8]);
        for (line, mended, expected) in [
            (
                4,
                "1.0",
                "line 4: found \"1.0\", expected the nominal density",
            ),
            (4, "# -1.0", "is not a usable material"),
            (6, "# 41", "line 49: found \"#[RAYLEIGH INTERACTIONS]\""),
            (
                6,
                "# 1e9",
                "line 6: found \"1000000000\", expected the number of energies",
            ),
            (7, "", "expected [MEAN FREE PATHS"),
            (20, "NaN 1 1 1 1 1", "line 20: found \"NaN 1 1 1 1 1\""),
            (20, "1 2 3", "line 20: found \"1 2 3\""),
            (10, long, "line 10: found \"5.0E3"),
            (
                9,
                &long.replace("0.0236", "0.0336"),
                "line 9: found \"0.0336 cm\", expected 0.023",
            ),
            (51, "# 61", "line 113: found"),
            (54, "0 0.5 0 0", "line 54: found"),
            (115, "# 3", "ends after line 118"),
            (117, "1 -1 1", "line 117: found \"1 -1 1\""),
        ] {
            let found = report(line, mended);
            assert!(found.contains(expected), "line {line} → {mended}: {found}");
        }
    }

    proptest::proptest! {
        /// Reading a damaged file returns a material or an error, whatever its content.
        #[test]
        fn a_damaged_file_is_read_or_refused(damage in mangled::damage()) {
            let water = Material::named("water").unwrap();
            let _ = read(&mangled::damaged(text(&water, &energies()).as_bytes(), &damage));
        }
    }
}
