//! The deterministic parts of the augmentations against OpenCV 4.8.1 and albumentations 1.3.1.
//!
//! `augmentation.json` was made by `scripts/make_augmentation_reference.py`; images are given by a formula, so the
//! file contains only results: all pixels of a small image, and weighted sums for the paper's size.

use ppa_learn::data::{RANGE_MM, Raster, box_blur, gradient, quantile, rotate};
use serde_json::Value;

fn reference() -> Value {
    serde_json::from_str(include_str!("augmentation.json")).unwrap()
}

fn depth(width: usize, height: usize) -> Raster<u16> {
    let at = |x: usize, y: usize| match (x * 7 + y * 13) % 29 {
        0 => 0,
        _ => (600 + (x * 37 + y * 61 + (x * y) % 97 * 5) % 1200) as u16,
    };
    let values = (0..width * height).map(|i| at(i % width, i / width));
    Raster::new(width, height, values.collect()).unwrap()
}

fn unit(width: usize, height: usize) -> Raster<f32> {
    depth(width, height).map(|mm| f32::from(mm.min(RANGE_MM)) / f32::from(RANGE_MM))
}

fn weighted<T: Copy>(image: &Raster<T>) -> f64
where
    f64: From<T>,
{
    let weight = |i: usize| (i * 7919 % 1009) as f64;
    let values = image.values().iter().enumerate();
    values.map(|(i, &v)| f64::from(v) * weight(i)).sum()
}

fn numbers(value: &Value) -> Vec<f64> {
    let numbers = value.as_array().unwrap().iter();
    numbers.map(|number| number.as_f64().unwrap()).collect()
}

/// Compares the sum of a large image to a relative 10⁻⁷ (f32 rounding averages out), and each pixel of a small one to 10⁻⁶.
fn compare<T: Copy>(expected: &Value, small: &Raster<T>, large: &Raster<T>)
where
    f64: From<T>,
{
    let sum = expected["large_weighted"].as_f64().unwrap();
    let found = weighted(large);
    assert!((found / sum - 1.0).abs() < 1e-7, "{found} instead of {sum}");
    let pixels = numbers(&expected["small"]);
    assert_eq!(small.values().len(), pixels.len());
    for (place, (&found, pixel)) in small.values().iter().zip(pixels).enumerate() {
        let found = f64::from(found);
        assert!(
            (found - pixel).abs() < 1e-6,
            "pixel {place}: {found} instead of {pixel}"
        );
    }
}

#[test]
fn sizes_change_by_opencvs_exact_nearest_neighbours() {
    for case in reference()["nearest_exact"].as_array().unwrap() {
        let side = |key: &str, axis: usize| case[key][axis].as_u64().unwrap() as usize;
        let image = depth(side("from", 0), side("from", 1));
        let resized = image.resized(side("to", 0), side("to", 1));
        assert_eq!(case["weighted"], weighted(&resized), "{case}");
    }
}

#[test]
fn images_are_mirrored() {
    let expected = reference()["flip"].as_f64().unwrap();
    let found = weighted(&unit(403, 403).mirrored());
    assert!(
        (found / expected - 1.0).abs() < 1e-12,
        "{found}, {expected}"
    );
}

#[test]
fn images_turn_as_albumentations_turns_them() {
    let (small, large) = (unit(13, 11), unit(403, 403));
    for case in reference()["rotate"].as_array().unwrap() {
        let degrees = case["degrees"].as_f64().unwrap();
        compare(case, &rotate(&small, degrees), &rotate(&large, degrees));
    }
}

#[test]
fn images_blur_as_albumentations_blurs_them() {
    let (small, large) = (unit(13, 11), unit(403, 403));
    for case in reference()["blur"].as_array().unwrap() {
        let side = case["side"].as_u64().unwrap() as usize;
        compare(case, &box_blur(&small, side), &box_blur(&large, side));
    }
}

#[test]
fn edges_are_those_of_opencv_and_numpy() {
    let reference = reference();
    let (small, large) = (gradient(&unit(13, 11)), gradient(&unit(403, 403)));
    compare(&reference["gradient"], &small, &large);
    let expected = &reference["quantile"];
    for (size, gradient) in [("small", &small), ("large", &large)] {
        let found = quantile(gradient.values(), 0.998);
        let expected = expected[size].as_f64().unwrap();
        assert!(
            (found - expected).abs() < 1e-9,
            "{size}: {found}, {expected}"
        );
    }
    let threshold = quantile(large.values(), 0.998);
    let above = large.values().iter().filter(|&&g| g > threshold).count();
    assert_eq!(expected["large_above"], above);
}
