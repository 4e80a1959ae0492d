//! MTF and DQE measured as in IEC 62220-1 from simulated images of an edge and of a uniform field, against those of the model.

use std::f64::consts::PI;

use nalgebra::{Matrix3, Point3, Rotation3, Vector3};
use ppa_ct::Grid;
use ppa_xray::{
    Blur, ComptonModel, DetectorModel, FastSettings, Material, PreparedPhantom, Projection,
    Radiograph, Spectrum, TubeSpec, VoxelPhantom,
};

use crate::noise_power::{SIDE, expected_power, spectrum};
use crate::scenes::{frontal, slab};

const PIXEL_MM: f64 = 0.148;
const H_MM2: f64 = 0.45;
const NOISE_H_MM2: f64 = 0.2;
const TILT_DEG: f64 = 3.0;
const FREQUENCIES_PER_MM: [f64; 6] = [0.5, 1.0, 1.5, 2.0, 2.5, 3.0];

/// RQA5 of IEC 61267.
fn rqa5() -> Spectrum {
    Spectrum::tungsten(&TubeSpec::new(70.0, 12.0, vec!["Al:23.5".parse().unwrap()])).unwrap()
}

/// Blur of the signal, and separately of the noise if `noise_h_mm2` is given.
fn blur(noise_h_mm2: Option<f64>) -> Blur {
    Blur::Lorentzian {
        h_mm2: H_MM2,
        noise_h_mm2,
    }
}

fn exposure(pixels: usize, blur: Option<Blur>, electronic_noise_kev: f64) -> Projection {
    let mut projection = frontal(pixels as u32, PIXEL_MM);
    projection.receptor.model = DetectorModel::Csi {
        thickness_um: 600.0,
        packing: 0.8,
    };
    projection.receptor.collection_swank = 0.92;
    projection.receptor.blur = blur;
    projection.receptor.electronic_noise_kev = electronic_noise_kev;
    projection
}

fn image(
    phantom: &PreparedPhantom,
    projection: &Projection,
    histories: f64,
    seed: u64,
) -> Radiograph {
    let settings = FastSettings::default()
        .with_dose_histories(histories)
        .with_scatter_histories(32)
        .with_samples_per_side(8)
        .with_seed(seed);
    phantom.fast(&rqa5(), projection, &settings).unwrap()
}

fn prepared(phantom: VoxelPhantom) -> PreparedPhantom<'static> {
    PreparedPhantom::new(phantom, ComptonModel::default())
}

/// A 1 mm tungsten plate 2 mm in front of the detector; its edge passes through the centre, slightly tilted against the columns.
fn edge() -> VoxelPhantom {
    let turn: Matrix3<f64> =
        Rotation3::from_axis_angle(&Vector3::z_axis(), TILT_DEG.to_radians()).into_inner();
    // Voxels from -100 to 0 mm and from 0 to 100 mm across the edge.
    let first = Point3::from(turn * Vector3::new(-50.0, 0.0, 97.5));
    let spacing = Vector3::new(100.0, 200.0, 1.0);
    let grid = Grid::from_parts([2, 1, 1], turn, spacing, first).unwrap();
    let tungsten = Material::named("tungsten").unwrap();
    VoxelPhantom::new(grid, vec![0; 2], vec![0.0, 19.3], vec![tungsten]).unwrap()
}

/// Presampled MTF: the Fourier transform of the derivative of the edge profile, sampled by all rows in bins of 1/8 pixel.
fn measured_mtf(image: &Radiograph) -> Vec<f64> {
    const BINS_PER_PIXEL: f64 = 8.0;
    const REACH: usize = 400;
    let (sin, cos) = TILT_DEG.to_radians().sin_cos();
    let mut bins = vec![(0.0, 0.0); 2 * REACH];
    for (pixel, value) in image.total().into_iter().enumerate() {
        let at = image.detector.pixel_centre_mm(pixel);
        let across = (at.x * cos + at.y * sin) / PIXEL_MM * BINS_PER_PIXEL;
        let bin = (across + REACH as f64).floor();
        if (0.0..2.0 * REACH as f64).contains(&bin) {
            let (sum, count) = &mut bins[bin as usize];
            *sum += f64::from(value);
            *count += 1.0;
        }
    }
    let profile: Vec<f64> = bins.iter().map(|(sum, count)| sum / count).collect();
    let step_mm = PIXEL_MM / BINS_PER_PIXEL;
    let lines: Vec<f64> = profile.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let transform = |per_mm: f64| {
        let (mut re, mut im) = (0.0, 0.0);
        for (i, line) in lines.iter().enumerate() {
            let (sin, cos) = (2.0 * PI * per_mm * i as f64 * step_mm).sin_cos();
            re += line * cos;
            im += line * sin;
        }
        // Binning and differences each blur by one bin.
        re.hypot(im) / sinc(per_mm * step_mm).powi(2)
    };
    FREQUENCIES_PER_MM
        .map(|f| transform(f) / transform(0.0))
        .to_vec()
}

fn sinc(x: f64) -> f64 {
    if x == 0.0 {
        1.0
    } else {
        (PI * x).sin() / (PI * x)
    }
}

fn model_mtf(per_mm: f64) -> f64 {
    sinc(per_mm * PIXEL_MM) / (1.0 + H_MM2 * per_mm * per_mm)
}

/// The blur kernel fits 1/(1 + H f²) within 0.012.
#[test]
fn mtf_measured_with_an_edge_is_that_of_the_model() {
    for noise_h_mm2 in [None, Some(NOISE_H_MM2)] {
        let projection = exposure(120, Some(blur(noise_h_mm2)), 0.0);
        let measured = measured_mtf(&image(&prepared(edge()), &projection, f64::INFINITY, 0));
        for (f, found) in FREQUENCIES_PER_MM.into_iter().zip(measured) {
            let expected = model_mtf(f);
            println!("{f}/mm: {found:.4}, model {expected:.4}");
            assert!(
                (found - expected).abs() < 0.015,
                "{f}/mm: {found}, model {expected}"
            );
        }
    }
}

/// DQE = MTF² / (Q NNPS) with Q photons per mm²; that of the model is absorption times Swank factor, reduced by electronic noise at high
/// frequencies.
#[test]
fn dqe_measured_with_an_even_field_is_that_of_the_model() {
    assert_dqe(None);
}

/// The DQE is lower by (MTF / noise transfer)², apart from aliasing and electronic noise.
#[test]
fn dqe_falls_where_noise_is_blurred_less_than_signal() {
    let (plain, lubberts) = (assert_dqe(None), assert_dqe(Some(NOISE_H_MM2)));
    for (ring, (plain, lubberts)) in plain.into_iter().zip(lubberts).enumerate() {
        // At the middle of the ring.
        let square = ((ring as f64 + 0.5) * 0.1 / PIXEL_MM).powi(2);
        let expected = ((1.0 + NOISE_H_MM2 * square) / (1.0 + H_MM2 * square)).powi(2);
        println!("ring {ring}: {:.3}, R {expected:.3}", lubberts / plain);
        if ring < 3 {
            assert!(
                (lubberts / plain / expected - 1.0).abs() < 0.08,
                "ring {ring}"
            );
        }
        assert!(lubberts < plain, "ring {ring}");
    }
}

/// Compares the DQE with the model in rings of frequency and returns the measured values.
fn assert_dqe(noise_h_mm2: Option<f64>) -> [f64; 5] {
    const IMAGES: u64 = 16;
    let vacuum = prepared(slab(10.0, 1e-9));
    let (photons, electronic_kev) = (600.0, 90.0);
    let mm2 = (SIDE as f64 * PIXEL_MM).powi(2);
    let histories = photons * (SIDE * SIDE) as f64;
    let per_mm2 = histories / mm2;
    let ev = |value: f64| value * PIXEL_MM * PIXEL_MM / 100.0 * histories;

    // One pixel without blur: mean and variance of the signal of the photons.
    let sharp = image(&vacuum, &exposure(SIDE, None, 0.0), histories, 0);
    let centre = SIDE * SIDE / 2 + SIDE / 2;
    let signal_kev = ev(sharp.open_field_ev_cm2) / 1e3;
    let variance_kev2 = (ev(f64::from(sharp.sigma()[centre])) / 1e3).powi(2);
    let swank_absorption = signal_kev * signal_kev / (variance_kev2 * photons);
    assert!(
        (0.65..0.8).contains(&swank_absorption),
        "{swank_absorption}"
    );

    let projection = exposure(SIDE, Some(blur(noise_h_mm2)), electronic_kev);
    let expected = image(
        &vacuum,
        &exposure(SIDE, Some(blur(noise_h_mm2)), 0.0),
        f64::INFINITY,
        0,
    )
    .total();
    let mut rings = [(0.0, 0.0, 0.0); 5];
    for seed in 1..=IMAGES {
        let noisy = image(&vacuum, &projection, histories, seed).total();
        let noise: Vec<f32> = noisy.iter().zip(&expected).map(|(a, b)| a - b).collect();
        for (i, power) in spectrum(&noise).into_iter().enumerate().skip(1) {
            let [fx, fy] = [i % SIDE, i / SIDE].map(|k| 0.5 * k as f64 / SIDE as f64);
            let ring = (fx.hypot(fy) * 10.0) as usize;
            if ring < rings.len() {
                let nps_kev2 = power * (ev(1.0) / 1e3).powi(2);
                let model_kev2 = variance_kev2
                    * expected_power(noise_h_mm2.unwrap_or(H_MM2), PIXEL_MM, fx, fy)
                    + electronic_kev * electronic_kev;
                let per_mm = |f: f64| f / PIXEL_MM;
                let mtf = 1.0 / (1.0 + H_MM2 * (per_mm(fx).powi(2) + per_mm(fy).powi(2)))
                    * sinc(fx)
                    * sinc(fy);
                let dqe = |power_kev2: f64| {
                    let nnps_mm2 = power_kev2 * PIXEL_MM * PIXEL_MM / (signal_kev * signal_kev);
                    mtf * mtf / (per_mm2 * nnps_mm2)
                };
                // Average powers, not their inverses.
                rings[ring].0 += nps_kev2 / model_kev2;
                rings[ring].1 += dqe(model_kev2);
                rings[ring].2 += 1.0;
            }
        }
    }
    let mut last = swank_absorption;
    let mut measured = [0.0; 5];
    for (ring, (ratio, dqe, count)) in rings.into_iter().enumerate() {
        let (ratio, model, error) = (ratio / count, dqe / count, (2.0 / count).sqrt());
        println!(
            "to {:.2}/mm: DQE {:.4} ± {:.4}, model {model:.4}",
            0.1 * (ring + 1) as f64 / PIXEL_MM,
            model / ratio,
            model * error
        );
        // 5 rings at 4.5 standard errors: 3e-5; plus 2 % for the fit of the curve.
        assert!(
            (ratio - 1.0).abs() < 4.5 * error + 0.02,
            "ring {ring}: {ratio} ± {error}"
        );
        assert!(model < last, "the DQE falls with the frequency");
        last = model;
        measured[ring] = model / ratio;
    }
    measured
}
