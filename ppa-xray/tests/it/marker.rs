//! The side marker attenuates images of both engines alike.

use nalgebra::{Isometry3, Point3, Vector3};
use ppa_ct::Grid;
use ppa_xray::{
    AnalogSettings, Category, FastSettings, Material, Radiograph, Side, SideMarker, VoxelPhantom,
    analog, fast, primary,
};

use crate::fast_engine::assert_scatter_agrees;
use crate::scenes::{frontal, limb, sixty_kvp};

/// 30 mm of water over the whole field: the signal is uniform within a pixel.
fn slab() -> VoxelPhantom {
    let first = Point3::new(-95.0, -95.0, -10.0);
    let grid = Grid::axis_aligned([20, 20, 3], Vector3::repeat(10.0), first).unwrap();
    let water = Material::named("water").unwrap();
    let voxels = grid.len();
    VoxelPhantom::new(grid, vec![0; voxels], vec![1.0; voxels], vec![water]).unwrap()
}

fn total(image: &Radiograph) -> Vec<f64> {
    image
        .total()
        .iter()
        .map(|&value| f64::from(value))
        .collect()
}

/// Primary in about 50 pixels that the letter covers by less than 70 %: χ² per degree of freedom exceeds 2.1 by chance once in 1e5.
#[test]
fn both_engines_leave_the_same_beside_the_letter() {
    let (phantom, spectrum) = (slab(), sixty_kvp());
    let bare = frontal(32, 5.0);
    let marker = SideMarker::new(Side::Right, [12.0, -15.0]).with_height_mm(90.0);
    let marked = bare.clone().with_marker(marker);
    let settings = AnalogSettings::default()
        .with_histories(2_000_000)
        .with_seed(41);
    let counted = analog(&phantom, &spectrum, &marked, &settings).unwrap();
    let settings = FastSettings::default()
        .with_dose_histories(f64::INFINITY)
        .with_scatter_histories(80_000)
        .with_seed(42);
    let expected = fast(&phantom, &spectrum, &marked, &settings).unwrap();
    let without = fast(&phantom, &spectrum, &bare, &settings).unwrap();
    assert_scatter_agrees(&expected, &counted);

    let (found, light) = (total(&expected), total(&without));
    let dark = found.iter().filter(|value| **value == 0.0).count();
    assert!(dark > 50, "{dark} pixels behind the letter");
    let layers = [&counted, &expected].map(|image| image.layer(Category::Primary));
    let (mut chi2, mut pixels) = (0.0, 0.0);
    for pixel in 0..found.len() {
        if found[pixel] == 0.0 {
            // Slivers narrower than a sixteenth of a pixel may remain uncovered.
            let counted = f64::from(counted.total()[pixel]);
            assert!(counted < 0.02 * light[pixel], "{counted}");
        } else if (0.3..0.99).contains(&(found[pixel] / light[pixel])) {
            let [counted, expected] = [0, 1].map(|n| f64::from(layers[n].value[pixel]));
            let sigma = f64::from(layers[0].sigma[pixel]);
            assert!(sigma > 0.0, "no photon in pixel {pixel}");
            chi2 += ((counted - expected) / sigma).powi(2);
            pixels += 1.0;
        }
    }
    println!("χ² {:.2} of {pixels} pixels", chi2 / pixels);
    assert!(pixels > 30.0 && chi2 / pixels < 2.1, "{chi2} of {pixels}");
}

/// Sums of layers equal the sums over their pixels, and the ray-traced primary shows the letter too.
#[test]
fn sums_and_the_ray_traced_primary_have_the_letter() {
    let (phantom, spectrum) = (limb(&Isometry3::identity()), sixty_kvp());
    let marker = SideMarker::new(Side::Left, [0.0; 2]).with_height_mm(70.0);
    let marked = frontal(32, 5.0).with_marker(marker);
    let settings = FastSettings::default()
        .with_dose_histories(f64::INFINITY)
        .with_scatter_histories(20_000);
    let image = fast(&phantom, &spectrum, &marked, &settings).unwrap();
    for category in Category::ALL {
        let values = &image.layer(category).value;
        let pixels: f64 = values.iter().map(|&value| f64::from(value)).sum();
        let pixels = pixels * 0.5 * 0.5; // cm²
        let (sum, _) = image.sums.of(category);
        assert!(
            (pixels / sum - 1.0).abs() < 0.01,
            "{category:?}: {pixels}, {sum}"
        );
    }
    let traced = primary(&phantom, &spectrum, &marked, 8).unwrap();
    let layer = &image.layer(Category::Primary).value;
    for (traced, value) in traced.iter().zip(layer) {
        let value = f64::from(*value);
        assert!(
            (traced - value).abs() <= 0.02 * traced.max(value),
            "{traced} {value}"
        );
    }
}
