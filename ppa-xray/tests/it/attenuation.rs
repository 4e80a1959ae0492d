//! Mass attenuation against published tables.

use std::{collections::HashMap, fs};

use ppa_xray::{ComptonModel, Material, MaterialTables};
use serde_json::Value;

use crate::shared;

/// NIST tables of Hubbell and Seltzer (NISTIR 5632), total with coherent scattering, cm²/g.
///
/// These data are not the EPDL97 of this crate: they differ by up to 2 % where the photoelectric effect dominates.
#[test]
fn totals_agree_with_the_nist_tables() {
    for (name, energy_kev, nist) in [
        ("water", 10.0, 5.329),
        ("water", 30.0, 0.3756),
        ("water", 60.0, 0.2059),
        ("water", 150.0, 0.1505),
        ("aluminium", 10.0, 26.23),
        ("aluminium", 30.0, 1.128),
        ("aluminium", 60.0, 0.2778),
        ("Ca", 30.0, 4.080),
        ("Cu", 30.0, 10.92),
        ("Cu", 60.0, 1.593),
        ("lead", 60.0, 5.021),
    ] {
        let total = Material::named(name)
            .unwrap()
            .total_cm2_g(energy_kev)
            .unwrap();
        assert!(
            (total / nist - 1.0).abs() < 0.02,
            "{name} at {energy_kev} keV: {total}, NIST {nist}"
        );
    }
}

/// Checks the piecewise linear transport tables on both sides of every edge and between edges.
#[test]
fn tables_for_transport_follow_the_material() {
    for name in [
        "water",
        "bone_cortical",
        "titanium",
        "csi",
        "gos",
        "lead",
        "U",
    ] {
        let material = Material::named(name).unwrap();
        let tables = MaterialTables::new(&material, ComptonModel::default());
        // K edges of Ti, I, Cs, Gd, Pb and U in xraylib's cross sections.
        let edges = [4.96600, 33.16996, 35.98653, 50.23664, 88.00069, 115.60101];
        let beside = edges
            .iter()
            .flat_map(|edge| [edge - 0.02, edge - 1e-4, edge + 1e-4, edge + 0.02]);
        for energy_kev in (0..3000)
            .map(|i| 150_f64.powf(f64::from(i) / 2999.0).min(150.0))
            .chain(beside)
        {
            let (direct, table) = (
                material.cross_sections(energy_kev).unwrap(),
                tables.cross_sections(energy_kev),
            );
            for (direct, table) in [
                (direct.photoelectric, table.photoelectric),
                (direct.rayleigh, table.rayleigh),
                (direct.compton, table.compton),
            ] {
                assert!(
                    (table / direct - 1.0).abs() < 1e-3,
                    "{name} at {energy_kev} keV: {table}, directly {direct}"
                );
            }
        }
    }
}

#[test]
#[ignore = "needs ../shared/reference/xray"]
fn every_interaction_is_within_a_percent_of_xraylib() {
    let materials: Value = serde_json::from_str(
        &fs::read_to_string(shared::path("reference/xray/materials_composition.json")).unwrap(),
    )
    .unwrap();
    let materials: HashMap<&str, Material> = materials
        .as_object()
        .unwrap()
        .iter()
        .map(|(name, entry)| {
            let fractions = entry["mass_fractions_by_Z"].as_object().unwrap().iter();
            let fractions: Vec<_> = fractions
                .map(|(z, w)| (z.parse().unwrap(), w.as_f64().unwrap()))
                .collect();
            let density = entry["density_g_cm3"].as_f64().unwrap();
            (
                name.as_str(),
                Material::from_composition(name, density, &fractions).unwrap(),
            )
        })
        .collect();
    let text =
        fs::read_to_string(shared::path("reference/xray/cross_sections_xraylib.csv")).unwrap();
    let (mut worst, mut rows) = ([0.0_f64; 5], 0);
    for line in text.lines().skip(1) {
        let columns: Vec<&str> = line.split(',').collect();
        let numbers: Vec<f64> = columns[2..]
            .iter()
            .map(|column| column.parse().unwrap())
            .collect();
        let material = &materials[columns[0]];
        let sections = material.cross_sections(numbers[0]).unwrap();
        let transfer = material.energy_transfer_cm2_g(numbers[0]).unwrap();
        let ours = [
            sections.photoelectric,
            sections.rayleigh,
            sections.compton,
            sections.total(),
            transfer,
        ];
        for (worst, (ours, reference)) in worst.iter_mut().zip(ours.into_iter().zip(&numbers[1..]))
        {
            let error = (ours / reference - 1.0).abs();
            assert!(error < 0.01, "{line}: {ours}");
            *worst = worst.max(error);
        }
        rows += 1;
    }
    assert_eq!(rows, 300, "ten materials at thirty energies");
    println!(
        "largest relative differences (photo, Rayleigh, Compton, total, transfer): {worst:.5?}"
    );
}
