//! Standard errors match the observed scatter.

use nalgebra::Isometry3;
use ppa_xray::{AnalogSettings, Category, Radiograph, analog};

use crate::scenes::{frontal, limb, sixty_kvp};

const SEEDS: u64 = 24;

/// The same exposure with other seeds.
fn images(histories: u64) -> Vec<Radiograph> {
    let phantom = limb(&Isometry3::identity());
    let spectrum = sixty_kvp();
    let projection = frontal(8, 13.0);
    (0..SEEDS)
        .map(|seed| {
            let settings = AnalogSettings::default()
                .with_histories(histories)
                .with_seed(seed);
            analog(&phantom, &spectrum, &projection, &settings).unwrap()
        })
        .collect()
}

/// Variance of the values about their mean over their mean stated variance: χ² per degree of freedom.
fn reduced_chi2(values: &[(f64, f64)]) -> f64 {
    let n = values.len() as f64;
    let mean = values.iter().map(|(value, _)| value).sum::<f64>() / n;
    let scatter: f64 = values.iter().map(|(value, _)| (value - mean).powi(2)).sum();
    let stated = values.iter().map(|(_, se)| se * se).sum::<f64>() / n;
    scatter / stated / (n - 1.0)
}

/// 23 degrees of freedom each; sums of a category fall outside 0.30 to 2.3 once in 1e4 at either end, the mean over 64
/// pixels (1472 degrees) falls outside 0.85 to 1.16 once in 3e4.
#[test]
fn seeds_scatter_as_the_standard_error_says() {
    let images = images(20_000);
    for category in Category::ALL {
        let sums: Vec<_> = images.iter().map(|image| image.sums.of(category)).collect();
        let found = reduced_chi2(&sums);
        assert!(
            (0.3..2.3).contains(&found),
            "{}: χ²/n = {found:.2}",
            category.name()
        );
    }
    let pixels = images[0].detector.pixels();
    let mean = (0..pixels)
        .map(|pixel| {
            let values = images.iter().map(|image| {
                (
                    f64::from(image.total()[pixel]),
                    f64::from(image.sigma()[pixel]),
                )
            });
            reduced_chi2(&values.collect::<Vec<_>>())
        })
        .sum::<f64>()
        / pixels as f64;
    assert!((0.85..1.16).contains(&mean), "pixels: χ²/n = {mean:.3}");
}

/// Nine times the histories give a third of the error: as stated (to 3 %) and as observed (64 x 23 degrees of freedom: the
/// ratio of two variances falls outside 9 ± 1.7 once in 1e5).
#[test]
fn the_error_falls_as_one_over_the_root_of_the_histories() {
    let (few, many) = (images(8_000), images(72_000));
    let stated = |images: &[Radiograph]| {
        let se = images
            .iter()
            .map(|image| image.sums.of(Category::Primary).1);
        se.sum::<f64>() / SEEDS as f64
    };
    let ratio = stated(&few) / stated(&many);
    assert!((ratio / 3.0 - 1.0).abs() < 0.03, "stated errors: {ratio}");
    let variance = |images: &[Radiograph]| -> f64 {
        let totals: Vec<Vec<f32>> = images.iter().map(Radiograph::total).collect();
        (0..images[0].detector.pixels())
            .map(|pixel| {
                let values = || totals.iter().map(|total| f64::from(total[pixel]));
                let mean = values().sum::<f64>() / SEEDS as f64;
                // Relative, so that bright pixels do not outweigh the others.
                values()
                    .map(|value| (value / mean - 1.0).powi(2))
                    .sum::<f64>()
            })
            .sum()
    };
    let ratio = variance(&few) / variance(&many);
    assert!(
        (7.3..10.7).contains(&ratio),
        "variances of seeds: {ratio:.2}"
    );
}
