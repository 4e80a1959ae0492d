//! The fast engine agrees with the analog engine, in the mean and in the errors.

use nalgebra::{Isometry3, Point3, Vector3};
use ppa_ct::Grid;
use ppa_xray::{
    AnalogSettings, Category, Collimation, Detector, Extrafocal, FastSettings, FocalSpot, Material,
    Projection, Radiograph, Source, Spectrum, SpotShape, VoxelPhantom, analog, fast, primary,
};

use crate::scenes::{demanding_source, frontal, limb, sixty_kvp};

const SCATTER: [Category; 3] = [Category::Compton, Category::Rayleigh, Category::Multiple];

/// The expected image, without quantum noise.
fn expected_image(scatter_histories: u64, seed: u64) -> FastSettings {
    FastSettings::default()
        .with_dose_histories(f64::INFINITY)
        .with_scatter_histories(scatter_histories)
        .with_seed(seed)
}

fn analog_settings(histories: u64, seed: u64) -> AnalogSettings {
    AnalogSettings::default()
        .with_histories(histories)
        .with_seed(seed)
}

/// Energy per history in `side`² blocks of the detector, and its variance if the pixels are independent.
fn blocks(image: &Radiograph, category: Category, side: usize) -> Vec<(f64, f64)> {
    let pixels = image.columns() / side;
    let layer = image.layer(category);
    let mut blocks = vec![(0.0, 0.0); side * side];
    for pixel in 0..layer.value.len() {
        let (column, row) = (pixel % image.columns(), pixel / image.columns());
        let block = &mut blocks[row / pixels * side + column / pixels];
        block.0 += f64::from(layer.value[pixel]);
        block.1 += f64::from(layer.sigma[pixel]).powi(2);
    }
    blocks
}

/// Compares 4 x 4 blocks of three kinds of scatter (χ² with 48 degrees of freedom) and the three sums.
pub fn assert_scatter_agrees(image: &Radiograph, expected: &Radiograph) {
    let mut chi2 = 0.0;
    for category in SCATTER {
        let (a, se_a) = image.sums.of(category);
        let (b, se_b) = expected.sums.of(category);
        let z = (a - b) / se_a.hypot(se_b);
        println!("{category:?}: {a:.3} ± {se_a:.3}, {b:.3} ± {se_b:.3}: z = {z:.1}");
        assert!(z.abs() < 4.5, "{category:?}: {a} {b}, z = {z:.1}"); // 7e-6; heavier tails of 8 estimates: 1e-3
        for ((found, shared), (expected, variance)) in blocks(image, category, 4)
            .into_iter()
            .zip(blocks(expected, category, 4))
        {
            // The pixels of a block share the error of the fast engine: up to 64 times the variance.
            let fast = 16.0 * shared;
            chi2 += (found - expected).powi(2) / (variance + fast);
        }
    }
    println!("χ² {chi2:.1}");
    assert!(chi2 < 97.0, "χ² = {chi2:.1} with 48 degrees of freedom"); // 4e-5
}

/// 12 mm of contrast medium with 5 % of iodine behind 8 mm of water.
fn contrast_medium() -> VoxelPhantom {
    let grid = Grid::axis_aligned(
        [16, 16, 5],
        Vector3::repeat(4.0),
        Point3::new(-30.0, -30.0, -8.0),
    );
    let grid = grid.unwrap();
    let [iodine, water] = ["iodine", "water"].map(|name| Material::named(name).unwrap());
    let contrast = Material::mixture("contrast", 1.05, &[(&iodine, 0.05), (&water, 0.95)]);
    let (material, density) = (0..grid.len())
        .map(|index| {
            let [.., k] = grid.voxel(index);
            if k < 2 { (0, 1.0) } else { (1, 1.05) }
        })
        .unzip();
    VoxelPhantom::new(grid, material, density, vec![water, contrast.unwrap()]).unwrap()
}

/// Three sums and 48 blocks, as for tissue; without K x-rays, multiple scatter would be 70 % too low.
#[test]
fn k_x_rays_behind_contrast_medium_are_those_of_analog() {
    let (phantom, spectrum) = (contrast_medium(), Spectrum::monoenergetic(50.0).unwrap());
    let projection = frontal(32, 5.0);
    let expected = analog(
        &phantom,
        &spectrum,
        &projection,
        &analog_settings(4_000_000, 31),
    );
    let image = fast(
        &phantom,
        &spectrum,
        &projection,
        &expected_image(80_000, 32),
    );
    assert_scatter_agrees(&image.unwrap(), &expected.unwrap());
}

#[test]
fn scatter_is_that_of_analog() {
    let (phantom, spectrum) = (limb(&Isometry3::identity()), sixty_kvp());
    let projection = frontal(32, 5.0);
    let expected = analog(
        &phantom,
        &spectrum,
        &projection,
        &analog_settings(1_000_000, 11),
    );
    let image = fast(
        &phantom,
        &spectrum,
        &projection,
        &expected_image(80_000, 12),
    )
    .unwrap();
    assert_scatter_agrees(&image, &expected.unwrap());
    let share = image.largest_score_share.unwrap();
    assert!(share > 0.0 && share < 0.5, "largest share {share}");
}

/// A focal spot of 8 mm, heel effect and a collimated field.
#[test]
fn scatter_of_a_demanding_source_is_that_of_analog() {
    let (phantom, spectrum) = (limb(&Isometry3::identity()), sixty_kvp());
    let mut projection = frontal(24, 6.0).with_source(demanding_source());
    let expected = analog(
        &phantom,
        &spectrum,
        &projection,
        &analog_settings(600_000, 13),
    );
    let image = fast(
        &phantom,
        &spectrum,
        &projection,
        &expected_image(40_000, 14),
    )
    .unwrap();
    let expected = expected.unwrap();
    assert_scatter_agrees(&image, &expected);
    let (a, (b, se)) = (
        image.sums.of(Category::Primary).0,
        expected.sums.of(Category::Primary),
    );
    assert!((a - b).abs() < 4.5 * se, "primary {a}, {b} ± {se}"); // 7e-6
    // The penumbra of the blades is 16 mm wide (standard deviation).
    let primaries = |image: &Radiograph| blocks(image, Category::Primary, 6);
    let (found, expected) = (primaries(&image), primaries(&expected));
    let terms = found.iter().zip(&expected);
    let chi2: f64 = terms
        .map(|((found, _), (expected, variance))| (found - expected).powi(2) / variance)
        .sum();
    assert!(chi2 < 79.0, "chi² = {chi2:.1} with 36 degrees of freedom"); // 5e-5
    projection.source.blades_mm = None;
    let settings = expected_image(320, 14);
    let sharp = fast(&phantom, &spectrum, &projection, &settings).unwrap();
    let share = found[0].0 / primaries(&sharp)[0].0;
    assert!((0.4..0.8).contains(&share), "{share} of the corner is left");
}

/// Extrafocal radiation of half the intensity from 30 mm, in a field of 90 mm, whose edges reach 45 mm to both sides.
#[test]
fn extrafocal_radiation_is_that_of_analog() {
    let (phantom, spectrum) = (limb(&Isometry3::identity()), sixty_kvp());
    let collimation = Collimation::Rectangle {
        size_mm: [90.0; 2],
        centre_mm: [10.0, 0.0],
    };
    let source = Source::default()
        .with_collimation(collimation)
        .with_blades_mm(Some(275.0))
        .with_extrafocal(Some(Extrafocal::new(0.5, 30.0)));
    let projection = frontal(24, 6.0).with_source(source);
    let settings = analog_settings(600_000, 15);
    let expected = analog(&phantom, &spectrum, &projection, &settings).unwrap();
    let settings = expected_image(40_000, 16);
    let image = fast(&phantom, &spectrum, &projection, &settings).unwrap();
    assert_scatter_agrees(&image, &expected);
    let (found, counted) = (
        blocks(&image, Category::Primary, 6),
        blocks(&expected, Category::Primary, 6),
    );
    let terms = found.iter().zip(&counted);
    let chi2: f64 = terms
        .map(|((found, _), (expected, variance))| (found - expected).powi(2) / variance)
        .sum();
    assert!(chi2 < 79.0, "chi² = {chi2:.1} with 36 degrees of freedom"); // 5e-5
    // The same rays in the deterministic primary.
    let exact: f64 = primary(&phantom, &spectrum, &projection, 4)
        .unwrap()
        .iter()
        .sum();
    let rays = &image.layer(Category::Primary).value;
    let sum: f64 = rays.iter().map(|&value| f64::from(value)).sum();
    assert!((sum / exact - 1.0).abs() < 2e-3, "{sum} {exact}");
    assert_eq!(image.histories_per_mas, expected.histories_per_mas);
    assert!((image.open_field_ev_cm2 / expected.open_field_ev_cm2 - 1.0).abs() < 1e-12);
}

/// Extrafocal photons change the image by up to a third. Their rays are traced on a 2 mm grid and compared with 64 points of the
/// area and 9 rays for each 1 mm pixel.
#[test]
fn primary_of_extrafocal_photons_is_that_of_many_rays() {
    let (phantom, spectrum) = (limb(&Isometry3::identity()), sixty_kvp());
    let collimation = Collimation::Rectangle {
        size_mm: [30.0, 90.0],
        centre_mm: [10.0, 0.0],
    };
    let source = Source::default()
        .with_collimation(collimation)
        .with_blades_mm(Some(275.0))
        .with_extrafocal(Some(Extrafocal::new(0.5, 30.0)));
    let projection = frontal(50, 1.0).with_source(source);
    let exact = primary(&phantom, &spectrum, &projection, 3).unwrap();
    let largest = exact.iter().copied().fold(0.0, f64::max);
    let sum: f64 = exact.iter().sum();
    for histories in [f64::INFINITY, 1e12] {
        let settings = expected_image(320, 1).with_dose_histories(histories);
        let image = fast(&phantom, &spectrum, &projection, &settings).unwrap();
        let values = image.layer(Category::Primary).value.iter();
        let errors = values
            .zip(&exact)
            .map(|(&value, exact)| f64::from(value) - exact);
        let errors: Vec<f64> = errors.collect();
        let bias = errors.iter().sum::<f64>() / sum;
        let worst = errors
            .iter()
            .fold(0.0, |most: f64, error| most.max(error.abs()))
            / largest;
        println!("{histories:e}: sum {bias:.1e}, largest {worst:.1e}");
        assert!(bias.abs() < 1e-3 && worst < 0.02, "{bias} {worst}");
    }
}

/// Adaptive rays and a few energies per spectrum against 64 x 64 rays per pixel and all energies.
#[test]
fn primary_is_that_of_many_rays() {
    let (phantom, spectrum) = (limb(&Isometry3::identity()), sixty_kvp());
    for (pixels, pixel_mm, usual, worst) in [(20, 5.0, 4e-3, 1e-2), (24, 0.5, 4e-3, 1.5e-2)] {
        let projection = frontal(pixels, pixel_mm);
        let exact = primary(&phantom, &spectrum, &projection, 64).unwrap();
        let settings = expected_image(320, 1).with_samples_per_side(64);
        let image = fast(&phantom, &spectrum, &projection, &settings).unwrap();
        let mut errors: Vec<f64> = exact
            .iter()
            .zip(&image.layer(Category::Primary).value)
            .map(|(exact, &value)| (f64::from(value) / exact - 1.0).abs())
            .collect();
        errors.sort_by(f64::total_cmp);
        let (most, largest) = (errors[errors.len() * 98 / 100], errors[errors.len() - 1]);
        println!("{pixel_mm} mm: 98 % below {most:.1e}, all below {largest:.1e}");
        assert!(most < usual && largest < worst, "{most} {largest}");
    }
}

/// A focal spot with a penumbra of 0.2, 0.5 and 2 pixels, against 64 rays per pixel from each of 64 points of the spot. The
/// pin's edges are steps of nine tenths of the signal.
#[test]
fn primary_of_a_focal_spot_is_that_of_many_rays() {
    let (phantom, spectrum) = (limb(&Isometry3::identity()), sixty_kvp());
    for (size_mm, shape) in [
        (1.0, SpotShape::Uniform),
        (2.5, SpotShape::Gaussian),
        (10.0, SpotShape::Uniform),
    ] {
        let mut projection = frontal(16, 0.8);
        projection.source.focal_spot = FocalSpot::default().with_size_mm(size_mm).with_shape(shape);
        let exact = primary(&phantom, &spectrum, &projection, 8).unwrap();
        let image = fast(&phantom, &spectrum, &projection, &expected_image(320, 1)).unwrap();
        let errors: Vec<f64> = exact
            .iter()
            .zip(&image.layer(Category::Primary).value)
            .map(|(exact, &value)| f64::from(value) / exact - 1.0)
            .collect();
        let n = errors.len() as f64;
        let mean = errors.iter().sum::<f64>() / n;
        let rms = (errors.iter().map(|e| e * e).sum::<f64>() / n).sqrt();
        let largest = errors.iter().fold(0.0_f64, |most, e| most.max(e.abs()));
        println!("{size_mm} mm: mean {mean:.1e}, rms {rms:.1e}, largest {largest:.1e}");
        assert!(mean.abs() < 1e-3 && rms < 6e-3 && largest < 2e-2);
    }
}

/// A straight edge with a penumbra three pixels wide darkens pixels that look uniform to rays from the middle of the spot.
/// The edge is a step of half the signal.
#[test]
fn the_shadow_of_an_edge_reaches_pixels_beside_it() {
    let grid = Grid::axis_aligned(
        [2, 1, 1],
        Vector3::new(200.0, 400.0, 40.0),
        Point3::new(-100.0, 0.0, 0.0),
    );
    let water = Material::named("water").unwrap();
    let phantom =
        VoxelPhantom::new(grid.unwrap(), vec![0; 2], vec![1e-6, 1.0], vec![water]).unwrap();
    let spectrum = Spectrum::monoenergetic(40.0).unwrap();
    let mut projection = Projection::new(
        Isometry3::translation(0.0, 0.0, -600.0),
        1_000.0,
        Detector::centred(24, 9, 0.25),
    );
    projection.source.focal_spot.size_mm = 1.2;
    let exact = primary(&phantom, &spectrum, &projection, 16).unwrap();
    let image = fast(&phantom, &spectrum, &projection, &expected_image(320, 1)).unwrap();
    let found = &image.layer(Category::Primary).value;
    let (row, open) = (4 * 24..5 * 24, exact[4 * 24]);
    for pixel in row {
        let error = (f64::from(found[pixel]) - exact[pixel]) / open;
        assert!(
            error.abs() < 2e-2,
            "pixel {pixel}: {error} of the open beam"
        );
    }
}

fn mean_and_variance(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let squares = values.iter().map(|value| (value - mean).powi(2));
    (mean, squares.sum::<f64>() / (n - 1.0))
}

/// Twenty seeds: the sums of each kind scatter according to their standard errors, four times the histories halve the
/// errors, and the means depend neither on the number of histories nor on the spacing of the points.
#[test]
#[ignore = "takes a minute"]
fn errors_are_what_twenty_seeds_show() {
    let (phantom, spectrum) = (limb(&Isometry3::identity()), sixty_kvp());
    let projection = frontal(32, 5.0);
    let sums = |scatter_histories: u64, scatter_pixel_mm: f64, seed: u64| {
        let settings =
            expected_image(scatter_histories, seed).with_scatter_pixel_mm(scatter_pixel_mm);
        let image = fast(&phantom, &spectrum, &projection, &settings).unwrap();
        SCATTER.map(|category| image.sums.of(category))
    };
    let of = |histories, pixel_mm| -> Vec<[(f64, f64); 3]> {
        (0..20)
            .map(|seed| sums(histories, pixel_mm, 100 + seed))
            .collect()
    };
    let expected = analog(
        &phantom,
        &spectrum,
        &projection,
        &analog_settings(8_000_000, 15),
    )
    .unwrap();
    let (few, many, close) = (of(16_000, 20.0), of(64_000, 20.0), of(16_000, 11.0));
    for (kind, category) in SCATTER.into_iter().enumerate() {
        let (truth, truth_se) = expected.sums.of(category);
        for (name, runs) in [("few", &few), ("many", &many), ("close", &close)] {
            let values: Vec<f64> = runs.iter().map(|run| run[kind].0).collect();
            let (mean, variance) = mean_and_variance(&values);
            let stated = runs.iter().map(|run| run[kind].1.powi(2)).sum::<f64>() / 20.0;
            let z = (mean - truth) / (variance / 20.0 + truth_se * truth_se).sqrt();
            println!(
                "{category:?} {name}: {mean:.3}, analog {truth:.3} ± {truth_se:.3}: z = {z:.1}; variance over stated {:.2}",
                variance / stated
            );
            // 9 comparisons of 4.5 standard errors each: 2e-4 with Student's t of 19 degrees of freedom.
            assert!(z.abs() < 4.5, "{category:?} {name}: z = {z:.1}");
            // χ² of 19 degrees of freedom over 19, and the estimate of the stated variance: 1e-3 for all.
            assert!((0.25..2.9).contains(&(variance / stated)));
        }
        let stated = |runs: &[[(f64, f64); 3]]| {
            runs.iter().map(|run| run[kind].1.powi(2)).sum::<f64>() / 20.0
        };
        let gain = stated(&few) / stated(&many);
        println!("{category:?}: variance falls by {gain:.2} for four times the histories");
        assert!((2.0..9.0).contains(&gain), "{category:?}: {gain}");
    }
}

/// Covariance of neighbouring pixels over variance: white noise has none. χ² of all pixels for the variance.
#[test]
fn noise_is_white_and_as_large_as_that_of_analog() {
    let phantom: VoxelPhantom = limb(&Isometry3::identity());
    let (spectrum, projection) = (sixty_kvp(), frontal(48, 2.0));
    let histories = 4e6;
    let image = |dose_histories: f64, seed: u64| {
        let settings = expected_image(320, seed)
            .with_dose_histories(dose_histories)
            .with_samples_per_side(2);
        fast(&phantom, &spectrum, &projection, &settings).unwrap()
    };
    let (noisy, smooth) = (image(histories, 5), image(f64::INFINITY, 5));
    let counted = analog(
        &phantom,
        &spectrum,
        &projection,
        &analog_settings(histories as u64 / 4, 6),
    )
    .unwrap();
    let difference: Vec<f64> = noisy
        .total()
        .iter()
        .zip(smooth.total())
        .map(|(noisy, smooth)| f64::from(noisy - smooth))
        .collect();
    // The variance in analog pixels is that of a quarter of the photons.
    let variance: Vec<f64> = counted
        .sigma()
        .iter()
        .map(|sigma| f64::from(*sigma).powi(2) / 4.0)
        .collect();
    let ratio = difference.iter().map(|d| d * d).sum::<f64>() / variance.iter().sum::<f64>();
    // Bright pixels dominate: about 1500 of them, √(2/1500) = 3.7 %.
    assert!(
        (ratio - 1.0).abs() < 0.17,
        "variance over that of analog: {ratio}"
    ); // 5e-6
    for (name, step) in [("right", 1), ("below", 48)] {
        let pairs = difference.iter().zip(&difference[step..]);
        let product: f64 = pairs.map(|(a, b)| a * b).sum();
        let correlation = product / difference.iter().map(|d| d * d).sum::<f64>();
        assert!(
            correlation.abs() < 0.12,
            "{name}: correlation {correlation}"
        ); // 4.5 of 1/√1500
    }
}

/// At the cut-off energy any Compton scattering ends a photon: the image has only primary and Rayleigh scatter.
#[test]
fn photons_of_the_cutoff_energy_make_an_image() {
    let phantom = limb(&Isometry3::identity());
    let spectrum = Spectrum::monoenergetic(5.0).unwrap();
    let image = fast(
        &phantom,
        &spectrum,
        &frontal(8, 5.0),
        &expected_image(320, 1),
    )
    .unwrap();
    assert!(image.total().iter().all(|reading| reading.is_finite()));
    assert_eq!(image.sums.of(Category::Compton).0, 0.0);
    assert!(image.sums.of(Category::Primary).0 > 0.0);
}

/// Absurd settings are refused with a one-sentence message.
#[test]
fn settings_beyond_all_sense_are_refused() {
    let (phantom, spectrum) = (limb(&Isometry3::identity()), sixty_kvp());
    let usual = expected_image(320, 1);
    for (settings, said) in [
        (
            usual.with_dose_histories(1e300),
            "the number of histories for the noise is 1e300, expected 1 to 1e18, or infinite for none",
        ),
        (
            usual.with_dose_histories(1e-300),
            "the number of histories for the noise is 1e-300, expected 1 to 1e18, or infinite for none",
        ),
        (
            usual.with_scatter_histories(u64::MAX),
            "the number of histories for the scatter is 1.8446744073709552e19, expected 1 to 1e8",
        ),
        (
            usual.with_scatter_pixel_mm(0.01),
            "the distance of the scatter points in mm is 0.01, expected a positive length that sets at most 100000 points on the detector",
        ),
    ] {
        let refused = fast(&phantom, &spectrum, &frontal(8, 5.0), &settings);
        assert_eq!(refused.unwrap_err().to_string(), said);
    }
}
