//! Case a of the reference data: a water cube with a bone cylinder, simulated by MC-GPU v1.3 with the same
//! photon data (xraylib).

use std::io::Read;

use flate2::read::GzDecoder;
use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use ppa_ct::Grid;
use ppa_xray::{
    AnalogSettings, Category, Detector, FastSettings, Material, Projection, Radiograph, Spectrum,
    VoxelPhantom, analog, fast, primary,
};
use serde_json::Value;

use crate::shared;

fn phantom() -> VoxelPhantom {
    let file = std::fs::File::open(shared::path("reference/xray/phantom_a.vox.gz")).unwrap();
    let mut text = String::new();
    GzDecoder::new(file).read_to_string(&mut text).unwrap();
    let (_, values) = text.split_once("[END OF VXH SECTION]").unwrap();
    let numbers: Vec<f32> = values
        .split_whitespace()
        .map(|number| number.parse().unwrap())
        .collect();
    let grid =
        Grid::axis_aligned([100; 3], Vector3::repeat(2.0), Point3::new(1.0, 1.0, 1.0)).unwrap();
    VoxelPhantom::new(
        grid,
        numbers
            .chunks(2)
            .map(|pair| if pair[0] == 5.0 { 0 } else { 1 })
            .collect(),
        numbers.chunks(2).map(|pair| pair[1]).collect(),
        vec![
            Material::named("water").unwrap(),
            Material::named("bone_cortical").unwrap(),
        ],
    )
    .unwrap()
}

/// Beam along ct y, columns along x; device y is therefore −z.
fn projection() -> Projection {
    let axes = Matrix3::from_columns(&[Vector3::x(), -Vector3::z(), Vector3::y()]);
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
    Projection::new(
        Isometry3::from_parts(Translation3::new(100.0, -850.0, 100.0), rotation),
        1_100.0,
        Detector::centred(300, 300, 1.0),
    )
}

fn spectrum() -> Spectrum {
    Spectrum::from_spc(shared::path("reference/xray/spectrum_60kVp.spc")).unwrap()
}

fn reference() -> Value {
    let text = std::fs::read_to_string(shared::path("reference/xray/case_a_mcgpu.json")).unwrap();
    serde_json::from_str(&text).unwrap()
}

/// Mean and standard error of a layer over a region of the reference, where z counts in the opposite direction to the rows.
fn region(image: &Radiograph, category: Category, bounds: &Value) -> (f64, f64) {
    let bound = |i: usize| bounds[i].as_u64().unwrap() as usize;
    let layer = image.layer(category);
    let (mut sum, mut variance, mut pixels) = (0.0, 0.0, 0.0);
    for z in bound(2)..bound(3) {
        for column in bound(0)..bound(1) {
            let pixel = (image.rows() - 1 - z) * image.columns() + column;
            sum += f64::from(layer.value[pixel]);
            variance += f64::from(layer.sigma[pixel]).powi(2);
            pixels += 1.0;
        }
    }
    (sum / pixels, variance.sqrt() / pixels)
}

/// Sums agree within the agreed tolerances, regions within 4.5 combined standard errors (20 comparisons: 1.4e-4 in all) plus
/// 0.5 % for the interpolation of the photon data. Pixels of the fast engine share the error of the scatter, so the error of
/// a region does not follow from theirs: `se_to_reference` then gives its ratio to the error of the reference (4e7 analog histories).
fn assert_agrees(image: &Radiograph, reference: &Value, se_to_reference: Option<f64>) {
    let mut total = 0.0;
    for (category, tolerance) in Category::ALL.into_iter().zip([0.01, 0.02, 0.03, 0.02]) {
        let (found, se) = image.sums.of(category);
        let expected = reference["energy_per_history_eV"][category.name()]
            .as_f64()
            .unwrap();
        let off = found / expected - 1.0;
        println!(
            "{:9} {found:10.3} ± {se:.3} eV, expected {expected:.3}: {:+.2} %",
            category.name(),
            100.0 * off
        );
        assert!(off.abs() < tolerance, "{}: {off}", category.name());
        total += found;
        for (name, roi) in reference["rois"].as_object().unwrap() {
            let (mean, pixel_se) = region(image, category, &roi["pixels_x0_x1_z0_z1"]);
            let expected = roi["mean_eV_cm2_per_history"][category.name()]
                .as_f64()
                .unwrap();
            let expected_se = roi["stderr"][category.name()].as_f64().unwrap();
            let se = se_to_reference.map_or(pixel_se, |ratio| ratio * expected_se);
            let z = (mean - expected) / se.hypot(expected_se).hypot(0.005 * expected);
            println!(
                "    {name:18} {mean:.5} ± {se:.5}, expected {expected:.5} ± {expected_se:.5}: z = {z:+.1}"
            );
            assert!(z.abs() < 4.5, "{} in {name}: z = {z}", category.name());
        }
    }
    let expected = reference["energy_per_history_eV"]["total"]
        .as_f64()
        .unwrap();
    assert!((total / expected - 1.0).abs() < 0.01);
}

#[test]
#[ignore = "needs ../shared/reference/xray"]
fn analog_agrees_with_mcgpu() {
    let settings = AnalogSettings::default()
        .with_histories(10_000_000)
        .with_seed(1);
    let image = analog(&phantom(), &spectrum(), &projection(), &settings).unwrap();
    assert_agrees(&image, &reference(), None);
}

#[test]
#[ignore = "needs ../shared/reference/xray"]
fn fast_agrees_with_mcgpu() {
    let settings = FastSettings::default()
        .with_scatter_histories(320_000)
        .with_dose_histories(f64::INFINITY)
        .with_seed(2);
    let image = fast(&phantom(), &spectrum(), &projection(), &settings).unwrap();
    assert_agrees(&image, &reference(), Some(2.0));
}

/// The reference integrates over random sub-pixel rays; its error is about 0.3 % (1 % behind bone).
#[test]
#[ignore = "needs ../shared/reference/xray"]
fn ray_traced_primary_agrees_with_the_analytic_reference() {
    let primary = primary(&phantom(), &spectrum(), &projection(), 4).unwrap();
    for (name, roi) in reference()["rois"].as_object().unwrap() {
        let bounds = &roi["pixels_x0_x1_z0_z1"];
        let bound = |i: usize| bounds[i].as_u64().unwrap() as usize;
        let rows = (bound(2)..bound(3)).map(|z| 299 - z);
        let values: Vec<f64> = rows
            .flat_map(|row| (bound(0)..bound(1)).map(move |column| row * 300 + column))
            .map(|pixel| primary[pixel])
            .collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let expected = roi["primary_analytic_xraylib_eV_cm2_per_history"]
            .as_f64()
            .unwrap();
        println!(
            "{name:18} {mean:.6}, expected {expected:.6}: {:+.2} %",
            100.0 * (mean / expected - 1.0)
        );
        assert!(
            (mean / expected - 1.0).abs() < 0.01,
            "{name}: {mean}, expected {expected}"
        );
    }
}
