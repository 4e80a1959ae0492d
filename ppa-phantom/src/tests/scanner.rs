//! Blur and noise.

use std::f64::consts::TAU;

use nalgebra::{Point3, Vector3};
use ppa_ct::Grid;
use ppa_ct::Volume;

use crate::Scanner;

/// A point spreads to a Gaussian of the stated width; noise has the stated standard deviation and no correlation.
#[test]
fn the_scanner_blurs_and_adds_noise_as_told() {
    let grid =
        Grid::axis_aligned([41, 41, 41], Vector3::new(0.5, 1.0, 2.0), Point3::origin()).unwrap();
    let mut hu = vec![0.0; grid.len()];
    hu[grid.index([20; 3])] = 2e5;
    let point = Volume::new(grid.clone(), hu).unwrap();
    let scanner = Scanner {
        blur_fwhm_mm: 4.0,
        noise_hu: 0.0,
        seed: 1,
    };
    let spread = scanner.scan(&point).unwrap();
    let sigma = 4.0 / 2.354_82;
    let peak = 2e5 / (2.0 * std::f64::consts::PI * sigma * sigma).powf(1.5);
    for offset in [[0, 0, 0], [4, 0, 0], [0, 2, 0], [0, 0, 1], [3, 1, 1]] {
        let [x, y, z] = [0, 1, 2].map(|a| [0.5, 1.0, 2.0][a] * offset[a] as f64);
        let expected = peak * (-(x * x + y * y + z * z) / (2.0 * sigma * sigma)).exp();
        let found = f64::from(spread.at([0, 1, 2].map(|a| 20 + offset[a])));
        assert!(
            (found / expected.min(3071.0) - 1.0).abs() < 0.02,
            "{found} for {expected}"
        );
    }

    let even = Volume::new(grid.clone(), vec![40.0; grid.len()]).unwrap();
    let noisy = |noise_hu, seed| {
        let scanner = Scanner {
            blur_fwhm_mm: 0.0,
            noise_hu,
            seed,
        };
        scanner.scan(&even).unwrap()
    };
    let n = grid.len() as f64;
    let noise: Vec<f64> = noisy(12.0, 3)
        .hu()
        .iter()
        .map(|hu| f64::from(*hu) - 40.0)
        .collect();
    let deviation = (noise.iter().map(|v| v * v).sum::<f64>() / n).sqrt();
    // Rounding adds 1/12; the standard error of a standard deviation is 1 / sqrt(2 n).
    let expected = (144.0_f64 + 1.0 / 12.0).sqrt();
    assert!((deviation / expected - 1.0).abs() < 4.0 / (2.0 * n).sqrt());
    let memory = noise.windows(2).map(|w| w[0] * w[1]).sum::<f64>() / n / 144.0;
    assert!(memory.abs() < 4.0 / n.sqrt());
    assert_ne!(noisy(12.0, 3), noisy(12.0, 4));
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .unwrap();
    assert_eq!(noisy(12.0, 3), pool.install(|| noisy(12.0, 3)));
    for (blur_fwhm_mm, noise_hu) in [(-1.0, 0.0), (f64::NAN, 0.0), (0.0, f64::INFINITY)] {
        let scanner = Scanner {
            blur_fwhm_mm,
            noise_hu,
            seed: 0,
        };
        assert!(
            scanner
                .scan(&even)
                .unwrap_err()
                .to_string()
                .contains("expected 0 to")
        );
    }
}

/// A line of voxels 1 mm apart that reads `hu` at each, blurred.
fn blurred_line(blur_fwhm_mm: f64, hu: impl Fn(f64) -> f64) -> Vec<f64> {
    let grid = Grid::axis_aligned([161, 1, 1], Vector3::repeat(1.0), Point3::origin()).unwrap();
    let line = (0..161).map(|n| hu(f64::from(n)) as f32).collect();
    let scanner = Scanner {
        blur_fwhm_mm,
        noise_hu: 0.0,
        seed: 0,
    };
    let line = Volume::new(grid, line).unwrap();
    let blurred = scanner.scan(&line).unwrap();
    blurred.hu().iter().map(|hu| f64::from(*hu)).collect()
}

/// The variance of the point spread and the contrast of waves 8 and 20 voxels long, exp(-(2π σ / λ)² / 2), from blurs far
/// below a voxel to several. Values are rounded to whole HU.
#[test]
fn blur_is_as_wide_as_stated_below_a_voxel_too() {
    for fwhm in [0.2, 0.4, 0.7, 1.0, 1.3, 2.0, 4.0] {
        let sigma = fwhm / 2.354_82;
        let spread = blurred_line(fwhm, |x| if x == 80.0 { 3000.0 } else { 0.0 });
        let moment = |power: i32| -> f64 {
            let places = (0..161).map(|n| f64::from(n - 80));
            spread
                .iter()
                .zip(places)
                .map(|(hu, x)| hu * x.powi(power))
                .sum()
        };
        let variance = moment(2) / moment(0);
        assert!(
            (variance - sigma * sigma).abs() < 0.02 * sigma * sigma + 5e-4,
            "{variance} for {fwhm} mm"
        );
        for wave in [8.0, 20.0] {
            let phase = |x: f64| (TAU * (x - 80.0) / wave).cos();
            let waves = blurred_line(fwhm, |x| 1000.0 * phase(x));
            // Away from the ends, over whole waves.
            let middle = (40..120).map(|n| waves[n] * phase(n as f64) / 40.0);
            let contrast = middle.sum::<f64>() / 1000.0;
            let expected = (-0.5 * (TAU * sigma / wave).powi(2)).exp();
            assert!(
                (contrast - expected).abs() < 0.006,
                "{contrast} for {expected} at {fwhm} mm"
            );
        }
    }
}
