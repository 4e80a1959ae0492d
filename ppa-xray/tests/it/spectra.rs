//! Tube spectra against SpekPy.

use std::fs;

use ppa_xray::{Spectrum, SpectrumError, TubeSpec};
use serde_json::Value;

use crate::shared;

/// Mean energy (keV), HVL1, HVL2 (mm Al), fluence (1/(mAs cm²)), air kerma (µGy/mAs), both at 1 m.
type Quality = [f64; 5];

/// Largest permitted relative differences: mean energy, HVL1, HVL2, fluence, kerma.
const TOLERANCE: Quality = [0.01, 0.02, 0.02, 0.02, 0.02];

fn quality(kvp: f64, anode_angle_deg: f64, filters: &str) -> Quality {
    let filters = filters
        .split_whitespace()
        .map(|filter| filter.parse().unwrap())
        .collect();
    let spectrum = Spectrum::tungsten(&TubeSpec::new(kvp, anode_angle_deg, filters)).unwrap();
    [
        spectrum.mean_energy_kev(),
        spectrum.hvl1_mm_al(),
        spectrum.hvl2_mm_al(),
        spectrum.fluence_per_mas_cm2_at_1m().unwrap(),
        spectrum.kerma_ugy_per_mas_at_1m().unwrap(),
    ]
}

fn assert_close(label: &str, ours: Quality, reference: Quality) {
    let difference: Vec<f64> = ours
        .iter()
        .zip(reference)
        .map(|(ours, reference)| ours / reference - 1.0)
        .collect();
    println!("{label}: {difference:+.4?}");
    assert!(
        difference
            .iter()
            .zip(TOLERANCE)
            .all(|(difference, tolerance)| difference.abs() < tolerance),
        "{label}: {difference:+.4?}"
    );
}

/// SpekPy 2.5.4 between the nodes of our table: `Spek(kvp, th, dk=0.5, z=100, mas=1).multi_filter(…)`.
#[test]
fn spectra_between_the_nodes_agree_with_spekpy() {
    for (kvp, angle, filters, reference) in [
        (
            42.5,
            6.5,
            "Al:1.0",
            [26.7248, 0.94715, 1.36436, 4.78776e+07, 55.2663],
        ),
        (
            47.0,
            7.5,
            "Al:2.5",
            [31.3444, 1.70910, 2.21244, 3.40130e+07, 26.8267],
        ),
        (
            53.3,
            11.0,
            "Al:2.5 Cu:0.1",
            [37.3590, 2.94802, 3.53351, 2.38795e+07, 13.1255],
        ),
        (
            62.0,
            15.0,
            "Al:1.2",
            [33.3597, 1.34114, 2.11784, 1.26077e+08, 105.6441],
        ),
        (
            68.7,
            9.5,
            "Al:2.5",
            [39.2797, 2.42943, 3.47350, 1.02427e+08, 60.0215],
        ),
        (
            72.5,
            9.5,
            "Al:2.5",
            [40.6384, 2.56150, 3.71095, 1.16828e+08, 65.8975],
        ),
        (
            81.0,
            13.0,
            "Al:3.0 Cu:0.3 Air:1000",
            [53.7221, 6.45366, 7.37497, 4.83399e+07, 16.8062],
        ),
        (
            97.3,
            18.5,
            "Al:0.5",
            [40.2106, 0.87418, 2.17095, 4.17547e+08, 374.5650],
        ),
        (
            109.0,
            6.5,
            "Al:2.5 Cu:0.1",
            [57.9073, 6.26119, 8.03866, 1.92267e+08, 70.5110],
        ),
        (
            133.0,
            10.5,
            "Al:2.5 Sn:0.3",
            [78.8232, 10.63348, 12.51526, 1.02349e+08, 35.8253],
        ),
        (
            147.5,
            16.0,
            "Al:4.0",
            [62.7101, 6.18196, 8.87607, 4.58599e+08, 179.9917],
        ),
        (
            55.0,
            1.2,
            "Al:2.5",
            [37.4553, 2.68228, 3.46526, 3.08156e+07, 17.6129],
        ),
        (
            75.0,
            2.7,
            "Al:2.5",
            [44.2901, 3.36756, 4.70505, 9.32271e+07, 44.9243],
        ),
        (
            90.0,
            4.5,
            "Al:2.5",
            [48.3522, 3.74430, 5.47719, 1.62820e+08, 73.9650],
        ),
        (
            120.0,
            27.0,
            "Al:2.5",
            [52.7647, 3.67734, 6.09281, 3.96855e+08, 184.4675],
        ),
        (
            60.0,
            12.0,
            "Al:2.5 Cu:0.1",
            [40.1429, 3.32119, 4.07660, 3.73830e+07, 18.7521],
        ),
    ] {
        assert_close(
            &format!("{kvp} kV, {angle}°, {filters}"),
            quality(kvp, angle, filters),
            reference,
        );
    }
}

#[test]
#[ignore = "needs ../shared/reference/xray"]
fn reference_spectra_agree_with_spekpy() {
    let text = fs::read_to_string(shared::path("reference/xray/spectra_spekpy.json")).unwrap();
    let reference: Value = serde_json::from_str(&text).unwrap();
    for entry in reference["spectra"].as_array().unwrap() {
        let number = |key: &str| entry[key].as_f64().unwrap();
        let filters = entry["filters"].as_array().unwrap().iter();
        let filters: Vec<_> = filters
            .map(|f| format!("{}:{}", f[0].as_str().unwrap(), f[1]))
            .collect();
        let reference = [
            number("mean_energy_keV"),
            number("hvl1_mm_al"),
            number("hvl2_mm_al"),
            number("fluence_per_cm2_per_mAs_100cm"),
            number("air_kerma_uGy_per_mAs_100cm"),
        ];
        let (kvp, angle, filters) = (number("kvp"), number("anode_deg"), filters.join(" "));
        assert_close(
            &format!("{kvp} kV {filters}"),
            quality(kvp, angle, &filters),
            reference,
        );

        let file = entry["file"].as_str().unwrap();
        let csv = Spectrum::from_csv(shared::path(&format!("reference/xray/{file}"))).unwrap();
        let spc = Spectrum::from_spc(shared::path(&format!(
            "reference/xray/{}",
            file.replace("csv", "spc")
        )))
        .unwrap();
        // The same photons: only the attenuation of aluminium and the energy transfer of air can differ.
        for read in [csv, spc] {
            assert!((read.mean_energy_kev() / reference[0] - 1.0).abs() < 1e-3);
            let difference = read.hvl1_mm_al() / reference[1] - 1.0;
            assert!(difference.abs() < 0.02, "{file}: HVL1 {difference:+.4}");
        }
    }
}

#[test]
fn settings_outside_the_model_are_refused() {
    let tube = |kvp, anode_angle_deg, filters| {
        Spectrum::tungsten(&TubeSpec::new(kvp, anode_angle_deg, filters))
    };
    assert!(matches!(
        tube(30.0, 12.0, vec![]),
        Err(SpectrumError::TubeVoltage { .. })
    ));
    assert!(matches!(
        tube(f64::NAN, 12.0, vec![]),
        Err(SpectrumError::TubeVoltage { .. })
    ));
    assert!(matches!(
        tube(60.0, 35.0, vec![]),
        Err(SpectrumError::AnodeAngle { .. })
    ));
    assert!(matches!(
        tube(60.0, 12.0, vec!["Al:-1".parse().unwrap()]),
        Err(SpectrumError::FilterThickness { .. })
    ));
    assert!(matches!(
        tube(60.0, 12.0, vec!["lead:900".parse().unwrap()]),
        Err(SpectrumError::Dark)
    ));
    for text in ["Al", "Al:thick", "unobtainium:1"] {
        assert!(text.parse::<ppa_xray::Filter>().is_err(), "{text}");
    }
}
