//! Source and detector, the same for both engines.

use nalgebra::{Isometry3, Point3, Vector3};
use ppa_ct::Grid;
use ppa_xray::{
    AnalogSettings, AntiScatterGrid, Blur, Category, Collimation, ComptonModel, Detector,
    DetectorModel, Extrafocal, FastSettings, FocalSpot, HeelEffect, Material, PreparedPhantom,
    Projection, Receptor, Source, Spectrum, SpotShape, TubeSpec, VoxelPhantom, analog, fast,
    primary,
};

use crate::scenes::{frontal, slab};

fn spectrum() -> Spectrum {
    Spectrum::tungsten(&TubeSpec::new(75.0, 12.0, vec!["Al:3".parse().unwrap()])).unwrap()
}

fn grid() -> AntiScatterGrid {
    AntiScatterGrid::new(8.0, 40.0)
        .with_strip_mm(0.05)
        .with_strip("lead".to_owned())
        .with_interspace("aluminium".to_owned())
        .with_focus_mm(Some(900.0))
        .with_lines_along(Default::default())
}

/// All effects at once: focal spot, heel effect, field edges inside the detector, detector off-axis and rotated, grid at the
/// wrong distance, scintillator.
fn demanding() -> Projection {
    let mut projection = frontal(12, 20.0);
    projection.detector.centre_mm = [15.0, -10.0];
    projection = projection.with_detector_turned(0.1, -0.05);
    let [x, y] = projection.detector.centre_mm;
    projection.source = Source::default()
        .with_focal_spot(
            FocalSpot::default()
                .with_size_mm(3.0)
                .with_shape(SpotShape::Uniform),
        )
        .with_collimation(Collimation::Rectangle {
            size_mm: [210.0, 330.0],
            centre_mm: [x + 25.0, y],
        })
        .with_heel_effect(Some(HeelEffect::new(90.0)))
        .with_blades_mm(Some(250.0));
    projection.receptor = Receptor::default()
        .with_model(DetectorModel::Csi {
            thickness_um: 500.0,
            packing: 0.8,
        })
        .with_grid(Some(grid()));
    projection
}

/// The few energies of the fast engine against the full spectrum: the detector's response jumps at the K edges of CsI (33.2
/// and 36.0 keV) and of the grid's strips (69.5 keV).
#[test]
fn a_few_energies_know_the_edges_of_the_detector() {
    let phantom = slab(80.0, 1.0);
    let mut projection = frontal(60, 4.0);
    projection.receptor.model = DetectorModel::Csi {
        thickness_um: 600.0,
        packing: 0.8,
    };
    projection.receptor.grid = Some(grid().with_strip("tungsten".to_owned()));
    let settings = FastSettings::default()
        .with_dose_histories(f64::INFINITY)
        .with_scatter_histories(1);
    let all = primary(&phantom, &spectrum(), &projection, 2).unwrap();
    let few = fast(&phantom, &spectrum(), &projection, &settings).unwrap();
    let few = &few.layer(Category::Primary).value;
    let sum: f64 = few.iter().map(|&v| f64::from(v)).sum();
    let error = sum / all.iter().sum::<f64>() - 1.0;
    assert!(error.abs() < 3e-4, "{error:e}");
}

/// Analog against fast, each category over the quadrants of the detector: 16 differences, each within 4.2 standard errors
/// (4e-4 for all). Both engines must use the same source and detector.
#[test]
fn engines_agree_on_source_and_detector() {
    let (phantom, spectrum, projection) = (slab(80.0, 1.0), spectrum(), demanding());
    let histories = 300_000;
    let tallied = analog(
        &phantom,
        &spectrum,
        &projection,
        &AnalogSettings::default()
            .with_histories(histories)
            .with_seed(5),
    );
    let settings = FastSettings::default()
        .with_dose_histories(f64::INFINITY)
        .with_scatter_histories(300_000)
        .with_seed(6)
        .with_samples_per_side(4);
    let expected = fast(&phantom, &spectrum, &projection, &settings).unwrap();
    let tallied = tallied.unwrap();
    for category in Category::ALL {
        for quadrant in 0..4 {
            let pixels = (0..144)
                .filter(|pixel| pixel % 12 / 6 == quadrant % 2 && pixel / 12 / 6 == quadrant / 2);
            let (mut difference, mut variance, mut sum) = (0.0, 0.0, 0.0);
            for pixel in pixels {
                let (a, b) = (tallied.layer(category), expected.layer(category));
                difference += f64::from(a.value[pixel]) - f64::from(b.value[pixel]);
                variance += f64::from(a.sigma[pixel]).powi(2);
                sum += f64::from(b.value[pixel]);
            }
            // The scatter of the fast engine has the same number of histories, distributed over the quadrants.
            let both = if category == Category::Primary {
                1.0
            } else {
                2.0
            };
            let error = (both * variance).sqrt() + 5e-3 * sum;
            println!("{} {quadrant}: {:.2}", category.name(), difference / error);
            assert!(
                difference.abs() < 4.2 * error,
                "{} in quadrant {quadrant}: {difference} of {sum}",
                category.name()
            );
        }
    }
}

/// The focal spot blurs the shadow of an edge: standard deviation s/√12 · b/a for a square of side s, where a is the
/// distance from the source to the edge and b from the edge to the detector.
#[test]
fn the_penumbra_is_as_wide_as_geometry_says() {
    let grid = Grid::axis_aligned(
        [2, 1, 1],
        Vector3::new(200.0, 400.0, 0.5),
        Point3::new(-100.0, 0.0, 0.0),
    );
    let lead = Material::named("lead").unwrap();
    let phantom =
        VoxelPhantom::new(grid.unwrap(), vec![0; 2], vec![0.0, 11.35], vec![lead]).unwrap();
    let spectrum = Spectrum::monoenergetic(40.0).unwrap();
    let pixel_mm = 0.05;
    let mut projection = Projection::new(
        Isometry3::translation(0.0, 0.0, -600.0),
        1_000.0,
        Detector::centred(120, 1, pixel_mm),
    );
    let spread_mm = |projection: &Projection| {
        let image = primary(&phantom, &spectrum, projection, 4).unwrap();
        // The unattenuated field is not quite uniform: steps below 1e-3 of the edge are not part of it.
        let edge = image[0] - image[119];
        let steps = image.windows(2).map(|pair| pair[0] - pair[1]);
        let steps: Vec<f64> = steps
            .map(|step| if step > 1e-3 * edge { step } else { 0.0 })
            .collect();
        let sum: f64 = steps.iter().sum();
        let moment = |power: i32| -> f64 {
            let terms = steps.iter().enumerate();
            terms
                .map(|(i, step)| step / sum * (i as f64 * pixel_mm).powi(power))
                .sum()
        };
        (moment(2) - moment(1).powi(2)).sqrt()
    };
    assert!(spread_mm(&projection) < 0.05);
    projection.source.focal_spot.size_mm = 1.2;
    let expected = 1.2 / 12.0_f64.sqrt() * 400.0 / 600.0;
    let found = spread_mm(&projection);
    assert!(
        (found / expected - 1.0).abs() < 0.06,
        "{found} mm, expected {expected} mm"
    );
}

/// The edge of the field in vacuum has standard deviation s/√12 · (D/b − 1) for blades at b; the total signal is conserved.
#[test]
fn blades_blur_the_edges_of_the_field() {
    let vacuum = slab(10.0, 1e-9);
    let spectrum = Spectrum::monoenergetic(50.0).unwrap();
    let mut projection = frontal(200, 0.1);
    projection.detector.rows = 1;
    projection.detector.centre_mm = [50.0, 0.0];
    projection.source.collimation = Collimation::Rectangle {
        size_mm: [100.0; 2],
        centre_mm: [0.0; 2],
    };
    let sharp = primary(&vacuum, &spectrum, &projection, 8).unwrap();
    projection.source.focal_spot.size_mm = 1.2;
    projection.source.blades_mm = Some(275.0);
    let image = primary(&vacuum, &spectrum, &projection, 8).unwrap();
    let settings = FastSettings::default()
        .with_dose_histories(f64::INFINITY)
        .with_scatter_histories(320);
    let by_fast = fast(&vacuum, &spectrum, &projection, &settings).unwrap();
    for (pixel, value) in by_fast.total().into_iter().enumerate() {
        let error = f64::from(value) - image[pixel];
        assert!(error.abs() < 2e-3 * image[0], "pixel {pixel}: {error}");
    }
    let steps: Vec<f64> = image.windows(2).map(|pair| pair[0] - pair[1]).collect();
    let moment = |power: i32| -> f64 {
        // The unattenuated field is not quite uniform: use only the region within 2 mm of the edge.
        let terms = steps.iter().enumerate().take(120).skip(80);
        terms
            .map(|(i, step)| step * (0.1 * i as f64).powi(power))
            .sum::<f64>()
            / (image[80] - image[120])
    };
    let found_mm = (moment(2) - moment(1).powi(2)).sqrt();
    let expected_mm = 1.2 / 12.0_f64.sqrt() * 3.0;
    assert!(
        (found_mm / expected_mm - 1.0).abs() < 0.02,
        "{found_mm} mm, expected {expected_mm} mm"
    );
    let (sharp, blurred) = (sharp.iter().sum::<f64>(), image.iter().sum::<f64>());
    assert!((blurred / sharp - 1.0).abs() < 2e-3, "{blurred} {sharp}");
}

/// At a distance x beyond the edge of the field, the fraction ½ − x / ((D/b − 1) · side) of the extrafocal area is visible.
#[test]
fn extrafocal_radiation_passes_beyond_the_field() {
    let vacuum = slab(10.0, 1e-9);
    let spectrum = Spectrum::monoenergetic(50.0).unwrap();
    let mut projection = frontal(100, 2.0);
    projection.detector.rows = 1;
    projection.source.collimation = Collimation::Rectangle {
        size_mm: [100.0; 2],
        centre_mm: [0.0; 2],
    };
    projection.source.blades_mm = Some(275.0);
    let (ratio, size_mm) = (0.1, 20.0);
    projection.source.extrafocal = Some(Extrafocal::new(ratio, size_mm));
    let settings = FastSettings::default()
        .with_dose_histories(f64::INFINITY)
        .with_scatter_histories(320);
    let image = fast(&vacuum, &spectrum, &projection, &settings).unwrap();
    let values = image.total();
    // The whole area irradiates the middle of the field.
    let open = f64::from(values[50]) / (1.0 + ratio);
    assert!((f64::from(values[50]) / image.open_field_ev_cm2 - 1.0).abs() < 2e-3);
    for (pixel, value) in values.into_iter().enumerate() {
        let x_mm = (2.0 * pixel as f64 - 99.0).abs();
        let cos = 1_100.0 / f64::hypot(1_100.0, x_mm);
        let lit = (0.5 - (x_mm - 50.0) / (3.0 * size_mm)).clamp(0.0, 1.0);
        let inside = f64::from(u8::from(x_mm < 50.0));
        let expected = (inside + ratio * lit) * cos.powi(3) * open;
        let error = (f64::from(value) - expected) / open;
        // cos³θ varies slightly over the 20 mm of the area.
        assert!(error.abs() < 1e-3, "{x_mm} mm: {error}");
    }
}

/// Kerma at the skin per mAs: higher by the extrafocal ratio where the blades leave the whole area visible.
#[test]
fn extrafocal_radiation_adds_to_the_entrance_kerma() {
    let (phantom, spectrum) = (slab(80.0, 1.0), spectrum());
    let mut projection = frontal(20, 10.0);
    projection.source.blades_mm = Some(250.0);
    let gy_per_mas = |projection: &Projection| {
        let prepared = PreparedPhantom::new(&phantom, ComptonModel::default());
        let per_history = prepared.entrance_air_kerma_gy_per_history(&spectrum, projection);
        per_history.unwrap().unwrap() * projection.photons_per_mas(&spectrum).unwrap().unwrap()
    };
    let focal = gy_per_mas(&projection);
    projection.source.extrafocal = Some(Extrafocal::new(0.08, 20.0));
    let ratio = gy_per_mas(&projection) / focal;
    assert!((ratio - 1.08).abs() < 1e-6, "{ratio}");
}

#[test]
fn extrafocal_radiation_out_of_proportion_is_refused() {
    let refused = |extrafocal: Extrafocal, blades_mm: Option<f64>| {
        let mut projection = frontal(10, 1.0);
        projection.source.extrafocal = Some(extrafocal);
        projection.source.blades_mm = blades_mm;
        projection.validate().unwrap_err().to_string()
    };
    for (ratio, size_mm) in [
        (0.0, 20.0),
        (1.1, 20.0),
        (f64::NAN, 20.0),
        (0.1, 0.0),
        (0.1, 111.0),
    ] {
        let error = refused(Extrafocal::new(ratio, size_mm), Some(275.0));
        assert!(error.contains("a tenth of the distance"), "{error}");
    }
    // 20 mm · (1100 / 50 − 1) in a field of 10 mm.
    let error = refused(Extrafocal::new(0.1, 20.0), Some(50.0));
    assert!(error.contains("420 mm wide"), "{error}");
    let error = refused(Extrafocal::new(0.1, 20.0), None);
    assert!(error.contains("collimator blades"), "{error}");
}

#[test]
fn blades_whose_shadow_fills_the_field_are_refused() {
    let mut projection = frontal(10, 1.0);
    projection.source.focal_spot.size_mm = 2.0;
    let refused = |blades_mm: f64| {
        let mut projection = projection.clone();
        projection.source.blades_mm = Some(blades_mm);
        projection.validate()
    };
    // 1100 mm · 1 mm / (5 mm + 1 mm).
    assert!(refused(183.4).is_ok() && refused(1_100.0).is_ok());
    for blades_mm in [183.3, 0.0, 1_100.1, f64::NAN] {
        let error = refused(blades_mm).unwrap_err().to_string();
        assert!(
            error.contains("expected 183.3 mm,") && error.contains("to 1100 mm,"),
            "{error}"
        );
    }
}

/// Outside the field only scatter arrives; a pixel cut by the edge reads its share; photons that miss the detector are
/// counted as histories.
#[test]
fn the_field_has_sharp_edges() {
    let vacuum = slab(10.0, 1e-9);
    let spectrum = Spectrum::monoenergetic(50.0).unwrap();
    let mut projection = frontal(10, 10.0);
    let open = primary(&vacuum, &spectrum, &projection, 2).unwrap();
    projection.source.collimation = Collimation::Rectangle {
        size_mm: [45.0, 400.0],
        centre_mm: [0.0, 0.0],
    };
    let image = primary(&vacuum, &spectrum, &projection, 2).unwrap();
    let row = &image[50..60];
    assert!(row[..2].iter().all(|&value| value == 0.0));
    assert!((row[2] / row[3] - 0.25).abs() < 0.01, "{row:?}");
    // 45 x 400 mm instead of 100 x 100 mm receive the same photons: 1.8 times the area, less obliquity.
    let share = row[5] / open[55];
    assert!((share - 1.0 / 1.8).abs() < 0.01, "{share}");
    let settings = AnalogSettings::default()
        .with_histories(40_000)
        .with_seed(1);
    let tallied = analog(&vacuum, &spectrum, &projection, &settings).unwrap();
    let on_detector = tallied.sums.primary_ev_per_history / 50e3;
    let expected: f64 = image.iter().sum::<f64>() / 50e3;
    let error = (expected * (1.0 - expected) / 40_000.0).sqrt();
    assert!((on_detector - expected).abs() < 4.0 * error); // 6e-5
}

/// The reading per mAs in the unattenuated field falls with the square of the distance; the field of a fan grows with it.
#[test]
fn readings_per_mas_follow_the_inverse_square() {
    let spectrum = spectrum();
    let at = |distance_mm: f64| {
        let mut projection = frontal(10, 10.0);
        projection.source_detector_mm = distance_mm;
        projection.source.collimation = Collimation::Fan {
            angles_deg: [8.0, 6.0],
        };
        let settings = FastSettings::default().with_scatter_histories(1);
        let image = fast(&slab(10.0, 1e-9), &spectrum, &projection, &settings).unwrap();
        (
            image.open_field_ev_cm2 * image.histories_per_mas.unwrap(),
            image.histories_per_mas,
        )
    };
    let (near, far) = (at(1_100.0), at(2_200.0));
    assert!(
        (near.0 / far.0 / 4.0 - 1.0).abs() < 1e-9,
        "{near:?}, {far:?}"
    );
    assert_eq!(
        near.1, far.1,
        "a fan takes the same photons at any distance"
    );
}

/// Quantum noise of a scintillator: variance over mean of the readings of many pixels is ⟨ε²⟩/⟨ε⟩, higher than for the ideal
/// detector by the Swank factor. The analog engine is compared with the moments of the table used by the fast engine.
#[test]
fn noise_of_a_scintillator_is_compound_poisson() {
    let vacuum = slab(10.0, 1e-9);
    let spectrum = Spectrum::monoenergetic(60.0).unwrap();
    let mut projection = frontal(40, 1.0);
    projection.receptor.model = DetectorModel::Csi {
        thickness_um: 400.0,
        packing: 0.8,
    };
    let histories = 400_000;
    let tallied = analog(
        &vacuum,
        &spectrum,
        &projection,
        &AnalogSettings::default()
            .with_histories(histories)
            .with_seed(3),
    );
    let settings = FastSettings::default()
        .with_dose_histories(histories as f64)
        .with_scatter_histories(1);
    let drawn = fast(&vacuum, &spectrum, &projection, &settings).unwrap();
    let of = |values: &[f32]| {
        let n = values.len() as f64;
        let mean = values.iter().map(|&v| f64::from(v)).sum::<f64>() / n;
        let variance = values
            .iter()
            .map(|&v| (f64::from(v) - mean).powi(2))
            .sum::<f64>()
            / n;
        (mean, variance)
    };
    let a = of(&tallied.unwrap().layer(Category::Primary).value);
    let b = of(&drawn.layer(Category::Primary).value);
    // 1600 pixels of 250 photons: variance to 3.5 % each, mean to 0.17 %; 4 sigma of the difference.
    assert!((a.0 / b.0 - 1.0).abs() < 0.010, "means {} and {}", a.0, b.0);
    assert!(
        (a.1 / b.1 - 1.0).abs() < 0.20,
        "variances {} and {}",
        a.1,
        b.1
    );
}

/// Blur and electronic noise of the read-out: readings scatter according to their standard errors, and both engines conserve
/// the sums. The noise of a blurred image is correlated, so the 10 000 pixels count as fewer.
#[test]
fn readings_scatter_as_their_standard_errors_say() {
    let vacuum = slab(10.0, 1e-9);
    let spectrum = Spectrum::monoenergetic(60.0).unwrap();
    let mut projection = frontal(100, 0.3);
    let histories = 400_000;
    let settings = AnalogSettings::default()
        .with_histories(histories)
        .with_seed(3);
    let sharp = analog(&vacuum, &spectrum, &projection, &settings).unwrap();
    projection.receptor.blur = Some(Blur::lorentzian(0.45));
    projection.receptor.electronic_noise_kev = 200.0;
    let followed = analog(&vacuum, &spectrum, &projection, &settings).unwrap();
    // Shares of photons are counted to 1/64 eV.
    let kept = followed.sums.total_ev_per_history() / sharp.sums.total_ev_per_history();
    assert!((kept - 1.0).abs() < 1e-6, "{kept}");
    let dose = FastSettings::default()
        .with_dose_histories(histories as f64)
        .with_scatter_histories(1);
    let drawn = fast(&vacuum, &spectrum, &projection, &dose).unwrap();
    for image in [followed, drawn] {
        let (total, sigma) = (image.total(), image.sigma());
        let n = total.len() as f64;
        let mean = total.iter().map(|&v| f64::from(v)).sum::<f64>() / n;
        let variance = total
            .iter()
            .map(|&v| (f64::from(v) - mean).powi(2))
            .sum::<f64>()
            / n;
        let expected = sigma.iter().map(|&s| f64::from(s).powi(2)).sum::<f64>() / n;
        // 2.5 % for the number of pixels; 4 sigma.
        assert!(
            (variance / expected - 1.0).abs() < 0.10,
            "{variance}, {expected}"
        );
        let electronic = image.electronic.unwrap();
        let share = (f64::from(electronic.sigma[0])).powi(2) / expected;
        assert!((0.3..0.95).contains(&share), "electronic share {share}");
        let sum: f64 = electronic.value.iter().map(|&v| f64::from(v)).sum();
        assert!(sum.abs() < 4.0 * n.sqrt() * f64::from(electronic.sigma[0]));
    }
    let expected = dose.with_dose_histories(f64::INFINITY);
    let clean = fast(&vacuum, &spectrum, &projection, &expected).unwrap();
    assert!(
        clean.electronic.is_none(),
        "the expected image has no noise"
    );
}
