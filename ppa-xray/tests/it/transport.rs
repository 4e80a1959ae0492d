//! Transport against analytical results.

use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use ppa_xray::{AnalogSettings, Category, FastSettings, Material, Spectrum, analog, fast, primary};

use crate::scenes::{frontal, limb, sixty_kvp, slab};

fn settings(histories: u64, seed: u64) -> AnalogSettings {
    AnalogSettings::default()
        .with_histories(histories)
        .with_seed(seed)
}

fn in_pool<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> T {
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .unwrap()
        .install(work)
}

#[test]
fn slab_follows_beer_lambert() {
    let histories = 200_000_u64;
    let mu_per_mm = Material::named("water").unwrap().total_cm2_g(60.0).unwrap() / 10.0;
    let p = f64::exp(-mu_per_mm * 100.0);
    // A field of 10 mm at 1.1 m: oblique paths are longer by at most 1e-5.
    let image = analog(
        &slab(100.0, 1.0),
        &Spectrum::monoenergetic(60.0).unwrap(),
        &frontal(10, 1.0),
        &settings(histories, 1),
    )
    .unwrap();
    let detected = image.sums.primary_ev_per_history / 60e3 * histories as f64;
    let sigma = (histories as f64 * p * (1.0 - p)).sqrt();
    let z = (detected - histories as f64 * p) / sigma;
    assert!(z.abs() < 4.0, "{z:.1} sigma from exp(−μt)"); // 6e-5
    let se = image.sums.primary_ev_per_history_se / 60e3 * histories as f64;
    assert!(
        (se / sigma - 1.0).abs() < 0.02,
        "standard error {se}, binomial {sigma}"
    );
}

#[test]
fn nothing_in_the_beam_brings_all_energy_to_the_detector() {
    let (vacuum, spectrum, projection) = (slab(100.0, 0.0), sixty_kvp(), frontal(60, 5.0));
    let mean_ev = 1e3 * spectrum.mean_energy_kev();
    let image = analog(&vacuum, &spectrum, &projection, &settings(400_000, 3)).unwrap();
    let (energy, se) = image.sums.of(Category::Primary);
    assert!(
        (energy - mean_ev).abs() < 4.0 * se,
        "{energy} ± {se}, expected {mean_ev}"
    );
    assert_eq!(image.sums.total_ev_per_history(), energy);
    let area_cm2 = 0.25;
    let tallied = image.total();
    let on_pixels: f64 = tallied.iter().map(|&v| f64::from(v) * area_cm2).sum();
    assert!((on_pixels / energy - 1.0).abs() < 1e-6);

    // The midpoint rule in pixels of 5 mm at 1.1 m leaves less than 1e-5.
    let traced = primary(&vacuum, &spectrum, &projection, 1).unwrap();
    assert!((traced.iter().sum::<f64>() * area_cm2 / mean_ev - 1.0).abs() < 1e-5);
    for (pixel, value) in traced.iter().enumerate() {
        assert!((image.open_field_at(pixel) / value - 1.0).abs() < 1e-4);
    }

    // Uniform in solid angle means cos³θ on the plane: 2.7 % less at 150 mm from the centre than at it.
    let rim: Vec<usize> = (0..traced.len())
        .filter(|pixel| (pixel % 60).abs_diff(30).max((pixel / 60).abs_diff(30)) > 26)
        .collect();
    let sum = |values: &dyn Fn(usize) -> f64| rim.iter().map(|&pixel| values(pixel)).sum::<f64>();
    let found = sum(&|pixel| f64::from(tallied[pixel]));
    let expected = sum(&|pixel| traced[pixel]);
    let sigma = sum(&|pixel| f64::from(image.layer(Category::Primary).sigma[pixel]).powi(2)).sqrt();
    let z = (found - expected) / sigma;
    assert!(z.abs() < 4.0, "the rim is {z:.1} sigma off"); // 6e-5
}

#[test]
fn tallied_and_ray_traced_primary_agree_pixel_by_pixel() {
    let (phantom, spectrum) = (limb(&Isometry3::identity()), sixty_kvp());
    let projection = frontal(20, 5.0);
    let histories = 600_000;
    let tallied = analog(&phantom, &spectrum, &projection, &settings(histories, 5)).unwrap();
    let traced = primary(&phantom, &spectrum, &projection, 16).unwrap();
    let layer = tallied.layer(Category::Primary);
    // The error bar of a dark pixel is reliable only if it caught photons: leave out the few that did not.
    let z2: Vec<f64> = traced
        .iter()
        .zip(layer.value.iter().zip(&layer.sigma))
        .filter(|(expected, _)| **expected * 0.25 * histories as f64 > 50.0 * 40e3)
        .map(|(expected, (value, sigma))| {
            ((f64::from(*value) - expected) / f64::from(*sigma)).powi(2)
        })
        .collect();
    let n = z2.len() as f64;
    assert!(n > 350.0, "{n} pixels");
    let deviation = (z2.iter().sum::<f64>() - n) / (2.0 * n).sqrt();
    assert!(deviation.abs() < 4.5, "χ² is {deviation:.1} sigma off"); // 1e-5
    let total: f64 = traced.iter().sum::<f64>() * 0.25;
    let (energy, se) = tallied.sums.of(Category::Primary);
    assert!(
        (energy - total).abs() < 4.0 * se,
        "{energy} ± {se}, ray-traced {total}"
    );
}

#[test]
fn turning_phantom_and_device_together_changes_nothing() {
    let spectrum = sixty_kvp();
    let turn = Isometry3::new(
        Vector3::new(40.0, -300.0, 120.0),
        UnitQuaternion::from_euler_angles(1.0, 0.4, -2.0).scaled_axis(),
    );
    let before = frontal(30, 3.0);
    let mut after = before.clone();
    after.ct_from_device = turn * before.ct_from_device;
    let (here, there) = (limb(&Isometry3::identity()), limb(&turn));
    let a = primary(&here, &spectrum, &before, 2).unwrap();
    let b = primary(&there, &spectrum, &after, 2).unwrap();
    for (a, b) in a.iter().zip(&b) {
        assert!((a / b - 1.0).abs() < 1e-6, "{a} {b}");
    }
    // The same random numbers: only histories changed by rounding may differ.
    let a = analog(&here, &spectrum, &before, &settings(50_000, 7)).unwrap();
    let b = analog(&there, &spectrum, &after, &settings(50_000, 7)).unwrap();
    let (a, b) = (a.sums.total_ev_per_history(), b.sums.total_ev_per_history());
    assert!((a / b - 1.0).abs() < 2e-4, "{a} {b}");
}

#[test]
fn threads_change_no_bit() {
    let (phantom, spectrum) = (limb(&Isometry3::identity()), sixty_kvp());
    let projection = frontal(16, 6.0);
    let both = |threads| {
        in_pool(threads, || {
            let fast_settings = FastSettings::default().with_scatter_histories(20_000);
            (
                analog(&phantom, &spectrum, &projection, &settings(20_000, 9)).unwrap(),
                fast(&phantom, &spectrum, &projection, &fast_settings).unwrap(),
            )
        })
    };
    assert_eq!(both(1), both(3));
}

#[test]
fn added_noise_has_the_stated_error() {
    let (phantom, spectrum) = (limb(&Isometry3::identity()), sixty_kvp());
    let projection = frontal(64, 2.0);
    let image = |dose_histories| {
        let settings = FastSettings::default()
            .with_dose_histories(dose_histories)
            .with_scatter_histories(20_000);
        fast(&phantom, &spectrum, &projection, &settings).unwrap()
    };
    let (noisy, expected) = (image(1e7), image(f64::INFINITY));
    let (noisy, expected) = (
        noisy.layer(Category::Primary),
        expected.layer(Category::Primary),
    );
    let z: Vec<f64> = (0..noisy.value.len())
        .map(|i| f64::from(noisy.value[i] - expected.value[i]) / f64::from(noisy.sigma[i]))
        .collect();
    let n = z.len() as f64;
    let mean = z.iter().sum::<f64>() / n;
    let variance = z.iter().map(|z| z * z).sum::<f64>() / n;
    assert!(mean.abs() * n.sqrt() < 4.5, "mean {mean}");
    assert!(
        (variance - 1.0).abs() < 5.0 * (2.0 / n).sqrt(),
        "variance {variance}"
    );
}
