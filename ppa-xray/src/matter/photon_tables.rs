//! Photon data of materials that are given by tables instead of a composition.

use crate::matter::electron_shell::Shell;

/// Photon data of one material, such as the contents of an MC-GPU material file.
///
/// Cross sections and form factors are interpolated log-log between nodes.
#[derive(Clone, Debug, PartialEq)]
pub struct PhotonTables {
    /// Nominal density in g/cm³.
    pub density_g_cm3: f64,
    /// Energies of the cross sections in keV, ascending; an edge may be listed twice.
    pub energies_kev: Vec<f64>,
    /// Photoelectric absorption at each energy, cm²/g.
    pub photoelectric_cm2_g: Vec<f64>,
    /// Compton scattering at each energy, cm²/g.
    pub compton_cm2_g: Vec<f64>,
    /// Rayleigh scattering at each energy, cm²/g.
    pub rayleigh_cm2_g: Vec<f64>,
    /// Pairs (q², F²), ascending in q²: q = sin(θ/2)/λ in 1/Å, F² up to a constant factor.
    ///
    /// Constant below the first node; the last power law continues beyond the last node.
    pub form_factor_squared: Vec<[f64; 2]>,
    /// Electron shells; only the ratios of their electron numbers matter.
    ///
    /// J₀ of an MC-GPU or PENELOPE file (FJ0, in 1/mₑc) is 137.036 times that of a [`Shell`].
    pub shells: Vec<Shell>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::matter::cross_sections::CrossSections;
    use crate::matter::material::Material;
    use crate::matter::material_error::MaterialError;

    /// Water as its tables, on the nodes of a file.
    fn water_tables() -> PhotonTables {
        let water = Material::named("water").unwrap();
        let energies_kev: Vec<f64> = (0..=2300).map(|i| 5.0 + 0.05 * f64::from(i)).collect();
        let of = |part: fn(&CrossSections) -> f64| {
            let value = |&e: &f64| part(&water.cross_sections(e).unwrap());
            energies_kev.iter().map(value).collect()
        };
        let squared = |i: u32| {
            let q = 0.01 * f64::from(i);
            [q * q, 7.0 * water.form_factor_squared_per_gram(q)]
        };
        let shell = |electrons, binding_kev, profile_at_zero| Shell {
            electrons,
            binding_kev,
            profile_at_zero,
        };
        PhotonTables {
            density_g_cm3: 1.0,
            photoelectric_cm2_g: of(|s| s.photoelectric),
            compton_cm2_g: of(|s| s.compton),
            rayleigh_cm2_g: of(|s| s.rayleigh),
            energies_kev,
            form_factor_squared: (0..=1000).map(squared).collect(),
            shells: vec![
                shell(2.0, 0.0136, 0.849),
                shell(4.0, 0.0071, 0.35),
                shell(2.0, 0.0285, 0.579),
                shell(2.0, 0.532, 0.113),
            ],
        }
    }

    #[test]
    fn tables_give_their_material_back() {
        let water = Material::named("water").unwrap();
        let tables = Material::from_tables("file", &water_tables()).unwrap();
        assert_eq!(tables.energy_range_kev(), [5.0, 120.0]);
        for energy_kev in [5.0, 12.34, 59.99, 120.0] {
            let (ours, theirs) = (
                tables.cross_sections(energy_kev).unwrap(),
                water.cross_sections(energy_kev).unwrap(),
            );
            assert!((ours.total() / theirs.total() - 1.0).abs() < 1e-4);
            assert!((ours.compton / theirs.compton - 1.0).abs() < 1e-4);
        }
        for q in [0.0, 0.004, 0.123, 1.0, 9.9] {
            let ratio = tables.form_factor_squared_per_gram(q)
                / water.form_factor_squared_per_gram(q)
                / 7.0;
            assert!((ratio - 1.0).abs() < 2e-3, "{q}: {ratio}");
        }
        // Every electron scatters far out; the profiles' S(q) is that of the atoms within a tenth.
        for (q, tolerance) in [(0.3, 0.12), (1.0, 0.05), (8.0, 0.01)] {
            let ours = tables.incoherent_per_gram(q) / 10.0;
            let theirs = water.incoherent_per_gram(q) * 18.015 / 10.0;
            assert!(
                (ours / theirs - 1.0).abs() < tolerance,
                "{q}: {ours} {theirs}"
            );
        }
        assert!(matches!(
            tables.total_cm2_g(4.9),
            Err(MaterialError::Energy { .. })
        ));
        assert!(matches!(
            Material::mixture("mixture", 1.0, &[(&tables, 0.5), (&water, 0.5)]),
            Err(MaterialError::NoComposition { .. })
        ));
    }

    #[test]
    fn tables_that_make_no_sense_are_refused() {
        let broken = |change: fn(&mut PhotonTables)| {
            let mut tables = water_tables();
            change(&mut tables);
            Material::from_tables("file", &tables).unwrap_err()
        };
        type Change = fn(&mut PhotonTables);
        let values: [Change; 7] = [
            |t| t.energies_kev[3] = f64::NAN,
            |t| t.compton_cm2_g[7] = -1.0,
            |t| t.photoelectric_cm2_g[0] = f64::INFINITY,
            |t| t.form_factor_squared[0][1] = 0.0,
            |t| t.shells[1].electrons = 0.0,
            |t| t.shells[1].binding_kev = -0.1,
            |t| t.shells[1].profile_at_zero = f64::NAN,
        ];
        for change in values {
            let error = broken(change);
            assert!(matches!(error, MaterialError::TableValue { .. }), "{error}");
            assert!(error.to_string().contains("expected "), "{error}");
        }
        let lengths: [Change; 6] = [
            |t| t.energies_kev.clear(),
            |t| t.energies_kev.truncate(1),
            |t| t.rayleigh_cm2_g.truncate(9),
            |t| t.form_factor_squared.clear(),
            |t| t.form_factor_squared.truncate(2),
            |t| t.shells.clear(),
        ];
        for change in lengths {
            let error = broken(change);
            assert!(
                matches!(error, MaterialError::TableLength { .. }),
                "{error}"
            );
        }
        let orders: [Change; 3] = [
            |t| t.energies_kev.swap(4, 5),
            |t| t.energies_kev[4..7].fill(5.3),
            |t| t.form_factor_squared[4][0] = 0.0,
        ];
        for change in orders {
            let error = broken(change);
            assert!(matches!(error, MaterialError::TableOrder { .. }), "{error}");
        }
        assert!(matches!(
            broken(|t| t.density_g_cm3 = 0.0),
            MaterialError::Density { .. }
        ));
        assert!(matches!(
            broken(|t| t.energies_kev.iter_mut().for_each(|e| *e *= 1e3)),
            MaterialError::TableRange { .. }
        ));
    }
}
