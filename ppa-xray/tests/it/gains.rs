//! Pixel gains: a fixed pattern of the panel in images of both engines.

use ppa_xray::{
    AnalogSettings, Category, FastSettings, Projection, Radiograph, Spectrum, analog, fast,
};

use crate::scenes::{frontal, slab};

const SIDE: u32 = 100;

fn exposure(gain_error: f64, panel: u32) -> Projection {
    let mut projection = frontal(SIDE, 0.5);
    projection.receptor.gain_error = gain_error;
    projection.receptor.panel = panel;
    projection
}

fn image(projection: &Projection, water_g_cm3: f32, histories: f64, seed: u64) -> Radiograph {
    let settings = FastSettings::default()
        .with_dose_histories(histories)
        .with_scatter_histories(1_000)
        .with_samples_per_side(1)
        .with_seed(seed);
    let spectrum = Spectrum::monoenergetic(60.0).unwrap();
    fast(&slab(10.0, water_g_cm3), &spectrum, projection, &settings).unwrap()
}

/// Gains of all pixels, from images with and without a gain error.
fn pattern(with: &Radiograph, without: &Radiograph) -> Vec<f32> {
    let pairs = with.total().into_iter().zip(without.total());
    pairs.map(|(a, b)| a / b).collect()
}

/// The pattern does not depend on seed, phantom or noise. In a uniform field of 1e4 pixels its spread is the gain error and its mean 1,
/// both within 4.5 standard errors. Another panel has another pattern.
#[test]
fn the_pattern_is_that_of_the_panel() {
    let (error, expected) = (0.02, f64::INFINITY);
    let gains = |panel, water, histories, seed| {
        let with = image(&exposure(error, panel), water, histories, seed);
        pattern(&with, &image(&exposure(0.0, panel), water, histories, seed))
    };
    let first = gains(0, 1e-9, expected, 1);
    let n = first.len() as f64;
    let mean = first.iter().map(|&g| f64::from(g)).sum::<f64>() / n;
    let square: f64 = first.iter().map(|&g| (f64::from(g) - mean).powi(2)).sum();
    let sigma = (square / n).sqrt();
    assert!((mean - 1.0).abs() < 4.5 * error / n.sqrt(), "{mean}");
    assert!(
        (sigma / error - 1.0).abs() < 4.5 / (2.0 * n).sqrt(),
        "{sigma}"
    );
    for (water, histories, seed) in [(1e-9, expected, 2), (1.0, expected, 1), (1.0, 1e9, 3)] {
        let other = gains(0, water, histories, seed);
        let most = first.iter().zip(&other).map(|(a, b)| (a - b).abs());
        assert!(
            most.fold(0.0, f32::max) < 1e-5,
            "{water} {histories} {seed}"
        );
    }
    let other = gains(1, 1e-9, expected, 1);
    let product = first
        .iter()
        .zip(&other)
        .map(|(&a, &b)| f64::from((a - 1.0) * (b - 1.0)));
    let correlation = product.sum::<f64>() / n / (error * error);
    assert!(correlation.abs() < 4.5 / n.sqrt(), "{correlation}");
}

/// The ratio of two images of a panel is free of the pattern; standard errors contain it, the electronic noise does not.
#[test]
fn flat_fielding_removes_the_pattern() {
    let expected = f64::INFINITY;
    let [behind, open] = [1.0, 1e-9].map(|water| image(&exposure(0.05, 0), water, expected, 1));
    let [plain_behind, plain_open] =
        [1.0, 1e-9].map(|water| image(&exposure(0.0, 0), water, expected, 1));
    let (corrected, plain) = (pattern(&behind, &open), pattern(&plain_behind, &plain_open));
    for (a, b) in corrected.iter().zip(&plain) {
        assert!((a / b - 1.0).abs() < 1e-5, "{a} {b}");
    }
    let noisy = |gain_error| {
        let mut projection = exposure(gain_error, 0);
        projection.receptor.electronic_noise_kev = 30.0;
        image(&projection, 1.0, 1e7, 1)
    };
    let (with, without) = (noisy(0.05), noisy(0.0));
    let [a, b] = [&with, &without].map(|image| image.layer(Category::Primary));
    for pixel in 0..a.value.len() {
        if b.value[pixel] > 0.0 {
            let [value, sigma] = [
                a.value[pixel] / b.value[pixel],
                a.sigma[pixel] / b.sigma[pixel],
            ];
            assert!((value / sigma - 1.0).abs() < 1e-5, "{value} {sigma}");
        }
    }
    // The electronic noise is the same with and without gains.
    let electronic = |image: &Radiograph, pixel: usize| {
        let photons = Category::ALL.map(|category| image.layer(category).value[pixel]);
        image.total()[pixel] - photons.iter().sum::<f32>()
    };
    let scale = with.open_field_ev_cm2 as f32;
    for pixel in [0, 1_234, 9_999] {
        let [a, b] = [&with, &without].map(|image| electronic(image, pixel));
        assert!((a - b).abs() < 1e-5 * scale && b != 0.0, "{a} {b}");
    }
}

/// Analog images have the same gains, for any number of threads.
#[test]
fn analog_images_have_the_gains_of_the_panel() {
    let spectrum = Spectrum::monoenergetic(60.0).unwrap();
    let settings = AnalogSettings::default().with_histories(300_000);
    let counted = |gain_error| {
        let projection = exposure(gain_error, 4);
        analog(&slab(10.0, 1e-9), &spectrum, &projection, &settings).unwrap()
    };
    let (with, without) = (counted(0.1), counted(0.0));
    let expected = pattern(
        &image(&exposure(0.1, 4), 1e-9, f64::INFINITY, 1),
        &image(&exposure(0.0, 4), 1e-9, f64::INFINITY, 1),
    );
    for ((a, b), gain) in with.total().iter().zip(without.total()).zip(expected) {
        assert!((a - b * gain).abs() <= 1e-5 * b, "{a} {b} {gain}");
    }
    let alone = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .unwrap();
    assert_eq!(alone.install(|| counted(0.1)).total(), with.total());
}
