//! Noise power spectrum of uniform exposures: both engines against the formula, with and without blur.
//!
//! Blur continues the image beyond its edges as its mirror image, so the cosine waves of the whole image stay separate:
//! their coefficients are independent, and their variance is the noise power at their frequency.

use std::f64::consts::PI;

use nalgebra::Isometry3;
use ppa_xray::{
    AnalogSettings, Blur, Category, Collimation, FastSettings, Projection, Radiograph, Spectrum,
    analog, fast,
};

use crate::scenes::{frontal, limb, sixty_kvp, slab};

pub const SIDE: usize = 64;
const PIXEL_MM: f64 = 0.3;
const H_MM2: f64 = 0.45;
const BANDS: usize = 8;
const HISTORIES: u64 = 200_000;

/// Noise power relative to white noise at a frequency in cycles per pixel; `h_mm2` is 0 without blur.
pub fn expected_power(h_mm2: f64, pixel_mm: f64, fx: f64, fy: f64) -> f64 {
    if h_mm2 == 0.0 {
        return 1.0;
    }
    let sinc = |f: f64| {
        if f == 0.0 {
            1.0
        } else {
            (PI * f).sin() / (PI * f)
        }
    };
    let aliases = || (-6..=6).map(f64::from);
    aliases()
        .flat_map(|x| aliases().map(move |y| (fx + x, fy + y)))
        .map(|(x, y)| {
            let mtf = 1.0 / (1.0 + h_mm2 * (x * x + y * y) / (pixel_mm * pixel_mm));
            (mtf * sinc(x) * sinc(y)).powi(2)
        })
        .sum()
}

fn power_of_blur(blur: Option<&Blur>, fx: f64, fy: f64) -> f64 {
    let h_mm2 = match blur {
        Some(Blur::Lorentzian { h_mm2, noise_h_mm2 }) => noise_h_mm2.unwrap_or(*h_mm2),
        _ => 0.0,
    };
    expected_power(h_mm2, PIXEL_MM, fx, fy)
}

/// Noise that is blurred less than the signal.
fn lubberts() -> Blur {
    Blur::Lorentzian {
        h_mm2: H_MM2,
        noise_h_mm2: Some(0.15),
    }
}

/// Squared coefficients of an image of [`SIDE`]² pixels in an orthonormal cosine basis.
pub fn spectrum(image: &[f32]) -> Vec<f64> {
    let wave = |k: usize, at: usize| {
        let scale = if k == 0 { 1.0_f64 } else { 2.0 };
        (scale / SIDE as f64).sqrt() * (PI * k as f64 * (at as f64 + 0.5) / SIDE as f64).cos()
    };
    // Transform along the rows, then along the columns of the result.
    let along = |plane: &[f64]| -> Vec<f64> {
        let pixels = (0..SIDE * SIDE).map(|i| (i / SIDE, i % SIDE));
        pixels
            .map(|(k, row)| (0..SIDE).map(|x| wave(k, x) * plane[row * SIDE + x]).sum())
            .collect()
    };
    let plane: Vec<f64> = image.iter().map(|&v| f64::from(v)).collect();
    along(&along(&plane)).iter().map(|c| c * c).collect()
}

/// Ratio of measured to expected noise power and number of coefficients, in rings of frequency; and the variance of a pixel,
/// measured and according to the standard errors, relative to white noise.
fn measured(images: &[Radiograph], blur: Option<&Blur>) -> ([(f64, f64); BANDS], [f64; 2]) {
    let mut bands = [(0.0, 0.0); BANDS];
    let [mut variance, mut stated] = [0.0; 2];
    for image in images {
        let cm2 = PIXEL_MM * PIXEL_MM / 100.0;
        let white = image.open_field_ev_cm2 * 60e3 / cm2 / image.histories;
        for (i, power) in spectrum(&image.total()).into_iter().enumerate().skip(1) {
            let [fx, fy] = [i % SIDE, i / SIDE].map(|k| 0.5 * k as f64 / SIDE as f64);
            let ring = (fx.hypot(fy) / 0.5_f64.sqrt() * BANDS as f64) as usize;
            bands[ring].0 += power / white / power_of_blur(blur, fx, fy);
            bands[ring].1 += 1.0;
            variance += power / white;
        }
        let squares = image.sigma().into_iter().map(|s| f64::from(s).powi(2));
        stated += squares.sum::<f64>() / white;
    }
    let pixels = (images.len() * SIDE * SIDE) as f64;
    let bands = bands.map(|(sum, count)| (sum / count, count));
    (bands, [variance / pixels, stated / pixels])
}

fn exposure(blur: Option<&Blur>) -> Projection {
    let mut projection = frontal(SIDE as u32, PIXEL_MM);
    projection.receptor.blur = blur.cloned();
    projection
}

/// Squares of normal variables have a variance of 2. Every ring agrees within 4.5 standard errors (7e-6 each, 16 rings per
/// engine: 1e-4) plus `slack` for simplifications of the engine; so do the variance and the stated variance.
fn assert_power(name: &str, images: &[Radiograph], blur: Option<&Blur>, slack: f64) {
    let (bands, [variance, stated]) = measured(images, blur);
    for (ring, (ratio, count)) in bands.into_iter().enumerate() {
        let error = (2.0 / count).sqrt();
        println!("{name}, ring {ring}: {ratio:.3} ± {error:.3}");
        assert!(
            (ratio - 1.0).abs() < 4.5 * error + slack,
            "{name}: noise power in ring {ring} is {ratio:.3} ± {error:.3} of what it should be"
        );
    }
    let powers = |shift: f64| -> Vec<f64> {
        let frequency = |k: usize| 0.5 * (k as f64 + shift) / SIDE as f64;
        let waves = (0..SIDE * SIDE).map(|i| (frequency(i % SIDE), frequency(i / SIDE)));
        waves.map(|(fx, fy)| power_of_blur(blur, fx, fy)).collect()
    };
    let of_waves = powers(0.0);
    let squares: f64 = of_waves.iter().map(|p| p * p).sum();
    let sum: f64 = of_waves.iter().sum();
    let error = (2.0 * squares / images.len() as f64).sqrt() / sum;
    let variance = variance / sum * (SIDE * SIDE) as f64;
    // Standard errors ignore the mirror, next to which pixels share more.
    let stated = stated / powers(0.5).iter().sum::<f64>() * (SIDE * SIDE) as f64;
    println!("{name}: variance {variance:.3} ± {error:.3}, stated {stated:.4}");
    assert!(
        (variance - 1.0).abs() < 4.5 * error + 0.5 * slack,
        "{name}: variance is {variance:.3} ± {error:.3} of what it should be"
    );
    // For photons of one energy the squares are known as precisely as their number: 1/√(16 x 200 000).
    assert!(
        (stated - 1.0).abs() < 0.003 + 0.5 * slack,
        "{name}: stated variance is {stated:.4}"
    );
}

fn drawn(blur: Option<&Blur>, seeds: u64) -> Vec<Radiograph> {
    let (vacuum, projection) = (slab(10.0, 1e-9), exposure(blur));
    let spectrum = Spectrum::monoenergetic(60.0).unwrap();
    let image = |seed| {
        let settings = FastSettings::default()
            .with_dose_histories(HISTORIES as f64)
            .with_scatter_histories(1)
            .with_samples_per_side(1)
            .with_seed(seed);
        fast(&vacuum, &spectrum, &projection, &settings).unwrap()
    };
    (0..seeds).map(image).collect()
}

fn counted(blur: Option<&Blur>, seeds: u64) -> Vec<Radiograph> {
    let (vacuum, projection) = (slab(10.0, 1e-9), exposure(blur));
    let spectrum = Spectrum::monoenergetic(60.0).unwrap();
    let image = |seed| {
        let settings = AnalogSettings::default()
            .with_histories(HISTORIES)
            .with_seed(seed);
        analog(&vacuum, &spectrum, &projection, &settings).unwrap()
    };
    (0..seeds).map(image).collect()
}

#[test]
fn noise_of_sharp_pixels_is_white() {
    assert_power("fast", &drawn(None, 16), None, 0.0);
    assert_power("analog", &counted(None, 16), None, 0.0);
}

/// 2 % for the fit of the curve; 2 % more because photons are spread over a square before they are counted.
#[test]
fn noise_behind_blur_has_the_power_of_the_detector() {
    let blur = Some(&Blur::lorentzian(H_MM2));
    assert_power("fast", &drawn(blur, 16), blur, 0.02);
    assert_power("analog", &counted(blur, 16), blur, 0.04);
}

/// As above, with the noise transfer instead of the MTF.
#[test]
fn noise_of_depth_dependent_blur_has_its_own_power() {
    let blur = lubberts();
    let blur = Some(&blur);
    assert_power("fast", &drawn(blur, 16), blur, 0.02);
    assert_power("analog", &counted(blur, 16), blur, 0.04);
}

/// The edge of a field that covers half of the detector, averaged over rows: both engines have the line spread of the MTF, not that of the
/// noise, and the same standard errors.
///
/// The noise of a column is at most that of white noise: 64 columns at 4.5 standard errors, a false alarm in 2000 runs. With the noise
/// transfer instead of the MTF, the column at the edge would differ by 0.078 of the open field.
#[test]
fn signal_behind_depth_dependent_blur_keeps_its_mtf() {
    const FINE_MM: f64 = 0.1;
    let mut projection = frontal(SIDE as u32, FINE_MM);
    projection.receptor.blur = Some(lubberts());
    let side_mm = SIDE as f64 * FINE_MM;
    projection.source.collimation = Collimation::Rectangle {
        size_mm: [0.5 * side_mm, side_mm],
        centre_mm: [-0.25 * side_mm, 0.0],
    };
    let (vacuum, spectrum) = (slab(10.0, 1e-9), Spectrum::monoenergetic(60.0).unwrap());
    let histories = 3_000_000;
    let settings = AnalogSettings::default().with_histories(histories);
    let counted = analog(&vacuum, &spectrum, &projection, &settings).unwrap();
    let image = |histories: f64| {
        let settings = FastSettings::default()
            .with_scatter_histories(1)
            .with_dose_histories(histories);
        fast(&vacuum, &spectrum, &projection, &settings).unwrap()
    };
    let (expected, drawn) = (image(f64::INFINITY), image(histories as f64));
    let columns = |values: &[f32]| -> Vec<f64> {
        let rows = values.chunks_exact(SIDE);
        let sum = |column: usize| {
            let values = rows.clone().map(|row| f64::from(row[column]));
            values.sum::<f64>()
        };
        (0..SIDE).map(|column| sum(column) / SIDE as f64).collect()
    };
    let open = counted.open_field_ev_cm2;
    let ev_cm2 = 60e3 / (FINE_MM * FINE_MM / 100.0);
    let error = (ev_cm2 / open / histories as f64 / SIDE as f64).sqrt();
    assert!(error < 0.004, "{error}");
    let [found, noiseless] = [&counted, &expected].map(|image| columns(&image.total()));
    let [stated, claimed] = [&counted, &drawn].map(|image| columns(&image.sigma()));
    // The line spread of 1/(1 + H f²) is exponential.
    let decay_mm = H_MM2.sqrt() / (2.0 * PI);
    let edge = |x: f64| match x {
        x if x < 0.0 => 1.0 - 0.5 * (x / decay_mm).exp(),
        x => 0.5 * (-x / decay_mm).exp(),
    };
    for column in 0..SIDE {
        let parts = (0..64).map(|i| (f64::from(i) + 0.5) / 64.0);
        let parts = parts.map(|part| edge((column as f64 - 0.5 * SIDE as f64 + part) * FINE_MM));
        let expected = parts.sum::<f64>() / 64.0;
        let [found, free] = [found[column], noiseless[column]].map(|value| value / open);
        let ratio = claimed[column] / stated[column];
        println!(
            "{column}: analog {found:.4}, fast {free:.4}, expected {expected:.4}; ratio of errors {ratio:.3}"
        );
        assert!(
            (found - expected).abs() < 4.5 * error + 0.012,
            "column {column}: {found}, expected {expected}"
        );
        assert!(
            (free - expected).abs() < 0.02,
            "column {column}: {free}, expected {expected}"
        );
        if expected > 0.04 {
            assert!((ratio - 1.0).abs() < 0.08, "column {column}: {ratio}");
        }
    }
}

/// ⟨E²⟩/⟨E⟩ of every category, the quantum of the fast engine's noise: variance of the noise times histories over signal.
/// Photon energies spread by a fifth, so the 3000 photons of the rarest category leave an error of 0.4 %, and the estimate of
/// the fast engine about as much: 1.5 % is about 3 standard errors.
#[test]
fn quanta_of_every_category_are_those_of_analog() {
    let (phantom, spectrum, projection) =
        (limb(&Isometry3::identity()), sixty_kvp(), frontal(16, 10.0));
    let settings = AnalogSettings::default()
        .with_histories(1_000_000)
        .with_seed(21);
    let counted = analog(&phantom, &spectrum, &projection, &settings).unwrap();
    // Few enough that the error of the scatter estimate is negligible relative to the noise.
    let settings = FastSettings::default()
        .with_dose_histories(100.0)
        .with_scatter_histories(20_000)
        .with_seed(22);
    let drawn = fast(&phantom, &spectrum, &projection, &settings).unwrap();
    for category in Category::ALL {
        let quantum_kev = |image: &Radiograph| {
            let squares = image
                .layer(category)
                .sigma
                .iter()
                .map(|&s| f64::from(s).powi(2));
            squares.sum::<f64>() * image.histories / image.sums.of(category).0 / 1e3
        };
        let (a, b) = (quantum_kev(&counted), quantum_kev(&drawn));
        println!("{category:?}: {a:.3} and {b:.3} keV, {:.4}", b / a);
        assert!(
            (b / a - 1.0).abs() < 0.015,
            "{category:?}: {a} keV, {b} keV"
        );
    }
}
