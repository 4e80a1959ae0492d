//! Lines of a stationary grid: both engines against each other, the moving grid and the Fourier series of the strips.

use std::f64::consts::PI;

use ppa_xray::{
    AnalogSettings, AntiScatterGrid, Blur, Detector, FastSettings, LinesAlong, Projection,
    Radiograph, Spectrum, analog, fast,
};

use crate::scenes::{frontal, slab};

const SIDE: usize = 80;

fn stationary() -> AntiScatterGrid {
    AntiScatterGrid::new(10.0, 40.0)
        .with_focus_mm(1_100.0)
        .with_moving(false)
}

fn exposure(pixel_mm: f64, grid: AntiScatterGrid, blur: Option<Blur>) -> Projection {
    let mut projection = frontal(SIDE as u32, pixel_mm);
    projection.receptor.grid = Some(grid);
    projection.receptor.blur = blur;
    projection
}

fn expected(projection: &Projection) -> Radiograph {
    let settings = FastSettings::default()
        .with_dose_histories(f64::INFINITY)
        .with_scatter_histories(1)
        .with_samples_per_side(1);
    let spectrum = Spectrum::monoenergetic(60.0).unwrap();
    fast(&slab(10.0, 1e-9), &spectrum, projection, &settings).unwrap()
}

/// Means of the lines of pixels, in order across the strips.
fn across(values: &[f32], lines_along: LinesAlong) -> Vec<f64> {
    let mean = |place: usize| {
        let pixel = |i: usize| match lines_along {
            LinesAlong::X => place * SIDE + i,
            _ => i * SIDE + place,
        };
        (0..SIDE).map(|i| f64::from(values[pixel(i)])).sum::<f64>() / SIDE as f64
    };
    (0..SIDE).map(mean).collect()
}

/// Amplitude of the wave of `cycles` per pixel, relative to the mean.
fn amplitude(values: &[f64], cycles: f64) -> f64 {
    let (mut re, mut im) = (0.0, 0.0);
    for (place, value) in values.iter().enumerate() {
        let (sin, cos) = (2.0 * PI * cycles * place as f64).sin_cos();
        re += value * cos;
        im += value * sin;
    }
    2.0 * re.hypot(im) / values.iter().sum::<f64>()
}

/// Lines of pixels agree within 5 standard errors and `slack` of the open field (80 lines, a false alarm in 2e4 runs); also checks the χ²
/// of the lines where they are independent.
fn assert_engines_agree(name: &str, projection: &Projection, slack: f64) {
    let histories = 2_000_000;
    let spectrum = Spectrum::monoenergetic(60.0).unwrap();
    let settings = AnalogSettings::default().with_histories(histories);
    let counted = analog(&slab(10.0, 1e-9), &spectrum, projection, &settings).unwrap();
    let model = expected(projection);
    let grid = projection.receptor.grid.as_ref().unwrap();
    let [found, expected] =
        [&counted, &model].map(|image| across(&image.total(), grid.lines_along));
    let open = model.open_field_ev_cm2;
    // Transmitted photons deposit their full energy.
    let pixel_cm2 = (projection.detector.pixel_mm / 10.0).powi(2);
    let ev_cm2 = 60e3 / pixel_cm2;
    let mut chi2 = 0.0;
    let contrast = expected.iter().copied().fold(0.0, f64::max)
        - expected.iter().copied().fold(f64::INFINITY, f64::min);
    assert!(contrast > 0.1 * open, "{name}: {contrast} of {open}");
    for (place, (found, expected)) in found.iter().zip(&expected).enumerate() {
        let error = (expected.max(0.01 * open) * ev_cm2 / histories as f64 / SIDE as f64).sqrt();
        let z = (found - expected) / error;
        chi2 += z * z;
        assert!(
            (found - expected).abs() < 5.0 * error + slack * open,
            "{name}, line {place}: {}, expected {}, z = {z:.1}",
            found / open,
            expected / open
        );
    }
    println!(
        "{name}: contrast {:.3}, χ² {chi2:.1} of {SIDE}",
        contrast / open
    );
    if slack == 0.0 {
        // 5 standard deviations of χ².
        assert!(
            chi2 < SIDE as f64 + 5.0 * (2.0 * SIDE as f64).sqrt(),
            "{name}: χ² {chi2}"
        );
    }
}

/// Sharp pixels: a grid at its focal distance, an unfocused one off the axis, where strips shade spaces, and one along the other axis.
#[test]
fn engines_agree_on_every_line_of_sharp_pixels() {
    assert_engines_agree("focused", &exposure(0.1, stationary(), None), 0.0);
    let mut beside = exposure(0.1, stationary().with_focus_mm(None), None);
    beside.detector = Detector::centred(SIDE as u32, SIDE as u32, 0.1).with_centre_mm([40.0, 3.0]);
    assert_engines_agree("beside the axis", &beside, 0.0);
    let along_x = stationary().with_lines_along(LinesAlong::X);
    assert_engines_agree("along x", &exposure(0.15, along_x, None), 0.0);
}

/// Strips as wide as the spaces have no second harmonic, which pixels of 0.1 mm would not resolve. 1 % covers the fit of the curve and the
/// blur of counted photons.
#[test]
fn engines_agree_on_lines_behind_blur() {
    let even = stationary().with_strip_mm(0.125);
    let blur = Some(Blur::lorentzian(0.1));
    assert_engines_agree("blurred", &exposure(0.1, even, blur), 0.01);
}

/// Opaque lead strips have the coefficients −sin(π m d/p)/π m; pixels multiply them by sinc, the converter by 1/(1 + H f²). 40 lines per cm
/// in pixels of 0.15 mm alias to |4 − 6.67| = 2.67 per mm, 0.4 per pixel, as do the harmonics 4, 6, 9, …; this is the strongest wave.
#[test]
fn moire_has_frequency_and_amplitude_of_the_alias() {
    let sinc = |x: f64| (PI * x).sin() / (PI * x);
    let coefficient = |m: f64| -0.2 * sinc(0.2 * m) / 0.8;
    for h_mm2 in [0.0, 0.45] {
        let blur = (h_mm2 > 0.0).then(|| Blur::lorentzian(h_mm2));
        let image = expected(&exposure(0.15, stationary(), blur));
        let values = across(&image.total(), LinesAlong::Y);
        let cycles = |k: usize| k as f64 / SIDE as f64;
        let strength = |k: usize| amplitude(&values, cycles(k));
        let largest = (1..=SIDE / 2)
            .max_by(|&a, &b| strength(a).total_cmp(&strength(b)))
            .unwrap();
        assert!((cycles(largest) / 0.15 - 2.667).abs() < 0.01, "{largest}");
        let transfer = |m: f64| 1.0 / (1.0 + h_mm2 * 16.0 * m * m);
        let waves = (1..2_000).map(f64::from).filter_map(|m| {
            let f = 0.6 * m;
            let same = ((f - f.round()).abs() - 0.4).abs() < 1e-6;
            // The strip on the centre lies between two pixels.
            let sign = if f.round() % 2.0 == 0.0 { 1.0 } else { -1.0 };
            same.then_some(2.0 * sign * coefficient(m) * sinc(f) * transfer(m))
        });
        let expected = waves.sum::<f64>().abs();
        let found = strength(largest);
        println!("H {h_mm2} mm²: amplitude {found:.4}, expected {expected:.4}");
        // The curve is fitted to 0.012; without blur the strips transmit 1e-4.
        let fit = if h_mm2 > 0.0 { 0.013 * 0.236 } else { 1e-3 };
        assert!((found - expected).abs() < fit, "{found}, {expected}");
    }
}

/// 5 pixels of 0.1 mm hold 2 periods: their mean is that of a moving grid, whatever the transmission of the strips.
#[test]
fn whole_periods_have_the_mean_of_a_moving_grid() {
    let thin = stationary()
        .with_strip_mm(0.1)
        .with_strip("aluminium")
        .with_interspace("polyethylene");
    for grid in [stationary(), thin] {
        let still = across(
            &expected(&exposure(0.1, grid.clone(), None)).total(),
            LinesAlong::Y,
        );
        let moving = expected(&exposure(0.1, grid.with_moving(true), None));
        let moving = across(&moving.total(), LinesAlong::Y);
        for (still, moving) in still.chunks_exact(5).zip(moving.chunks_exact(5)) {
            let [still_mean, moving_mean] = [still, moving].map(|v| v.iter().sum::<f64>() / 5.0);
            assert!(
                (still_mean / moving_mean - 1.0).abs() < 2e-4,
                "{still:?}, {moving:?}"
            );
            assert!((still[0] / moving[0] - 1.0).abs() > 1e-3, "{still:?}");
        }
    }
}

/// A stationary grid has the open field of a moving one, and so the same indices and presentations.
#[test]
fn open_field_is_that_of_a_moving_grid() {
    let still = expected(&exposure(0.15, stationary(), None));
    let moving = expected(&exposure(0.15, stationary().with_moving(true), None));
    assert_eq!(still.open_field_ev_cm2, moving.open_field_ev_cm2);
}
