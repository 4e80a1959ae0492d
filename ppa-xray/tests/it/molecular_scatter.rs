//! Rayleigh scattering with measured form factors.

use nalgebra::Isometry3;
use ppa_xray::{
    AnalogSettings, Category, ComptonModel, FastSettings, FormFactors, Material, MaterialTables,
    ScatterDensities, analog, fast,
};

use crate::fast_engine::assert_scatter_agrees;
use crate::scattering::uniforms;
use crate::scenes::{frontal, limb, sixty_kvp};

const HC_KEV_ANGSTROM: f64 = 12.398_42;

fn molecular(name: &str) -> Material {
    Material::named(name)
        .unwrap()
        .with_form_factors(FormFactors::Molecular)
}

/// F² from sampled angles, in bins of 0.01/Å around q: counts divided by 1 + cos²θ and by the width in q².
fn sampled_form_factor_squared(material: &Material, energy_kev: f64, samples: u32) -> Vec<f64> {
    let tables = MaterialTables::new(material, ComptonModel::default());
    let mut uniform = uniforms(71);
    let mut bins = vec![0.0; 100];
    for _ in 0..samples {
        let sin2_half_theta = tables.rayleigh_sin2_half_theta(energy_kev, &mut uniform);
        let q = sin2_half_theta.sqrt() * energy_kev / HC_KEV_ANGSTROM;
        let cos = 1.0 - 2.0 * sin2_half_theta;
        let bin = (100.0 * q + 0.5) as usize;
        if let Some(bin) = bins.get_mut(bin) {
            *bin += 1.0 / (1.0 + cos * cos);
        }
    }
    for (bin, sum) in bins.iter_mut().enumerate() {
        // q² from (bin − ½) to (bin + ½) hundredths; the first bin begins at 0.
        *sum /= if bin == 0 { 0.125 } else { bin as f64 };
    }
    bins
}

/// Liquid water has its peak at 0.16/Å and the lipids of fat at 0.11 to 0.12/Å, both far above the level near q = 0.
///
/// Narten and Levy 1971 and Kosanetzky et al., Med. Phys. 14 (1987) 526 give 1.6/nm and 1.1/nm. A bin at the peak holds about 3e4 of 1e6
/// samples: neighbours that differ by 2 % are 2.5 standard errors apart, hence a tolerance of one bin.
#[test]
fn peaks_of_water_and_fat_are_where_they_were_measured() {
    for (name, peak, at_zero) in [
        ("water", 16, 0.3447 / 3.519),
        ("adipose", 12, 0.6406 / 6.416),
    ] {
        let squared = sampled_form_factor_squared(&molecular(name), 30.0, 1_000_000);
        let highest = (1..squared.len())
            .max_by(|&a, &b| squared[a].total_cmp(&squared[b]))
            .unwrap();
        assert!(highest.abs_diff(peak) <= 1, "{name}: {highest}/100 Å");
        // 4 bins with 2e3 samples or more in total.
        let low = squared[1..5].iter().sum::<f64>() / 4.0 / squared[peak];
        assert!((low / at_zero - 1.0).abs() < 0.15, "{name}: {low}");
        // Free atoms have no peak.
        let atoms = sampled_form_factor_squared(&Material::named(name).unwrap(), 30.0, 1_000_000);
        assert!(atoms[3] > 1.1 * atoms[peak], "{name}");
    }
}

/// Each density integrates to 1 in steps that resolve the peaks.
#[test]
fn densities_of_measured_form_factors_integrate_to_one() {
    for name in ["water", "adipose", "pmma", "marrow_red"] {
        let densities = ScatterDensities::new(&molecular(name), ComptonModel::default());
        for energy_kev in [5.0, 14.0, 40.0, 150.0] {
            let steps = 10_000;
            let whole: f64 = (0..steps)
                .map(|i| {
                    let s = (f64::from(i) + 0.5) / f64::from(steps);
                    let cos = 1.0 - 2.0 * s * s;
                    8.0 * std::f64::consts::PI * s * densities.rayleigh_density(energy_kev, cos)
                })
                .sum();
            let whole = whole / f64::from(steps);
            assert!(
                (whole - 1.0).abs() < 1e-3,
                "{name} {energy_kev} keV: {whole}"
            );
        }
    }
}

/// As in `fast_engine::scatter_is_that_of_analog`; also checks that the choice changes the image.
#[test]
fn molecular_scatter_of_the_fast_engine_is_that_of_analog() {
    let atoms = limb(&Isometry3::identity());
    let phantom = atoms.clone().with_form_factors(FormFactors::Molecular);
    let (spectrum, projection) = (sixty_kvp(), frontal(32, 5.0));
    let settings = AnalogSettings::default()
        .with_histories(1_000_000)
        .with_seed(13);
    let expected = analog(&phantom, &spectrum, &projection, &settings).unwrap();
    let settings = FastSettings::default()
        .with_dose_histories(f64::INFINITY)
        .with_scatter_histories(80_000)
        .with_seed(14);
    let [image, of_atoms] =
        [&phantom, &atoms].map(|p| fast(p, &spectrum, &projection, &settings).unwrap());
    assert_scatter_agrees(&image, &expected);
    let [(molecular, _), (atoms, _)] = [&image, &of_atoms].map(|i| i.sums.of(Category::Rayleigh));
    assert!(molecular > 1.03 * atoms, "{molecular} {atoms}");
}
