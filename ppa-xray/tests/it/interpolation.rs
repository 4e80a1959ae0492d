//! Trilinear interpolation of density between voxel centres, the same in every engine.

use nalgebra::{Isometry3, Point3, UnitVector3, Vector3};
use ppa_ct::Grid;
use ppa_xray::{
    AnalogSettings, Category, FastSettings, Interpolation, Material, Spectrum, VoxelPhantom,
    analog, fast, primary,
};

use crate::scenes::{frontal, limb, sixty_kvp};

/// The limb of the other tests has density steps at bone, pin and skin in all directions.
fn smooth_limb() -> VoxelPhantom {
    limb(&Isometry3::identity()).with_interpolation(Interpolation::Trilinear)
}

/// Sums of all categories, fast and analog: four differences beyond 4.5 standard errors are a false alarm once in 4e4. The primary
/// is known to 0.1 %, scatter to 0.7 to 1.5 %.
#[test]
fn engines_agree_on_a_trilinear_limb() {
    let (phantom, spectrum, projection) = (smooth_limb(), sixty_kvp(), frontal(32, 5.0));
    let analog_settings = AnalogSettings::default()
        .with_histories(1_000_000)
        .with_seed(21);
    let fast_settings = FastSettings::default()
        .with_dose_histories(f64::INFINITY)
        .with_scatter_histories(60_000)
        .with_seed(22);
    let expected = analog(&phantom, &spectrum, &projection, &analog_settings).unwrap();
    let image = fast(&phantom, &spectrum, &projection, &fast_settings).unwrap();
    for category in Category::ALL {
        let ((a, se_a), (b, se_b)) = (image.sums.of(category), expected.sums.of(category));
        let z = (a - b) / se_a.hypot(se_b);
        println!("{category:?}: {a:.3} ± {se_a:.3}, {b:.3} ± {se_b:.3}: z = {z:+.1}");
        assert!(z.abs() < 4.5, "{category:?}: {a} {b}, z = {z:.1}");
    }
    // The primary of all pixels except the darkest, which receive only a few photons.
    let layer = expected.layer(Category::Primary);
    let found = &image.layer(Category::Primary).value;
    let (mut chi2, mut pixels) = (0.0, 0.0);
    for (pixel, (value, sigma)) in layer.value.iter().zip(&layer.sigma).enumerate() {
        if *sigma < 0.2 * value {
            chi2 += f64::from((value - found[pixel]) / sigma).powi(2);
            pixels += 1.0;
        }
    }
    let z = (chi2 - pixels) / f64::sqrt(2.0 * pixels);
    println!("primary: χ² = {chi2:.0} of {pixels} pixels, z = {z:+.1}");
    assert!(pixels > 900.0 && z.abs() < 4.5, "{chi2} {pixels}");
}

/// Pixels of a third of a voxel and of one voxel and a focal spot, with few rays each, against 64 rays from each of 64 points of the spot.
/// The expected image has no noise that could hide errors.
#[test]
fn primary_of_fine_pixels_is_that_of_many_rays() {
    let (phantom, spectrum) = (smooth_limb(), sixty_kvp());
    for (pixels, pixel_mm, usual, worst) in [(48, 0.6, 1.5e-3, 5e-3), (24, 1.7, 4e-3, 1.5e-2)] {
        let mut projection = frontal(pixels, pixel_mm);
        projection.source.focal_spot.size_mm = 0.6;
        let exact = primary(&phantom, &spectrum, &projection, 8).unwrap();
        let settings = FastSettings::default()
            .with_dose_histories(f64::INFINITY)
            .with_scatter_histories(320);
        let image = fast(&phantom, &spectrum, &projection, &settings).unwrap();
        let mut errors: Vec<f64> = exact
            .iter()
            .zip(&image.layer(Category::Primary).value)
            .map(|(exact, &value)| (f64::from(value) / exact - 1.0).abs())
            .collect();
        errors.sort_by(f64::total_cmp);
        let rms = (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt();
        let (most, largest) = (errors[errors.len() * 98 / 100], errors[errors.len() - 1]);
        println!("{pixel_mm} mm: rms {rms:.1e}, 98 % below {most:.1e}, all below {largest:.1e}");
        assert!(most < usual && largest < worst, "{most} {largest}");
    }
}

/// A beam along a density step between two voxel centres: the density between them is interpolated, and each pixel
/// is attenuated as by a wedge one voxel wide.
#[test]
fn step_between_two_voxels_is_a_ramp_one_voxel_wide() {
    // Vacuum and water side by side, each 2 mm wide and 10 mm thick, with the step at x = 0.
    let grid = Grid::axis_aligned(
        [2, 1, 1],
        Vector3::new(2.0, 40.0, 10.0),
        Point3::new(-1.0, 0.0, 0.0),
    );
    let water = Material::named("water").unwrap();
    let phantom = VoxelPhantom::new(
        grid.unwrap(),
        vec![0; 2],
        vec![0.0, 1.0],
        vec![water.clone()],
    )
    .unwrap()
    .with_interpolation(Interpolation::Trilinear);
    let spectrum = Spectrum::monoenergetic(60.0).unwrap();
    // A distant source and a close detector make the rays nearly parallel.
    let projection = frontal(37, 0.1)
        .with_source_detector_mm(9_006.0)
        .with_ct_from_device(Isometry3::translation(0.0, 0.0, -9_000.0));
    let image = primary(&phantom, &spectrum, &projection, 8).unwrap();
    let mu = water.cross_sections(60.0).unwrap().total() / 10.0;
    let row = &image[18 * 37..19 * 37];
    for (column, value) in row.iter().enumerate() {
        let x = (column as f64 - 18.0) * 0.1;
        let density = ((x + 1.0) / 2.0).clamp(0.0, 1.0);
        let expected = (-mu * 10.0 * density).exp();
        let found = value / row[0];
        // Skip the pixels at the ends of the ramp.
        let ends = (x.abs() - 1.0).abs() < 0.06;
        assert!(
            ends || (found / expected - 1.0).abs() < 2e-4,
            "{x}: {found} {expected}"
        );
    }
}

/// A bone of 24 mm tilted by 17 degrees against the axis of the slices, each voxel with the density at its centre; edges are 1.5 mm wide.
fn tilted_bone(slice_mm: f64, interpolation: Interpolation) -> VoxelPhantom {
    let size = [60, 60, (66.0 / slice_mm).round() as usize];
    let spacing = Vector3::new(0.8, 0.8, slice_mm);
    let first = Point3::new(-23.6, -33.0 + 0.5 * slice_mm, -23.6);
    let grid = Grid::from_parts(
        size,
        // Slices across device y.
        nalgebra::Matrix3::new(1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, -1.0, 0.0),
        spacing,
        Point3::new(first.x, first.y, -first.z),
    )
    .unwrap();
    let axis = UnitVector3::new_normalize(Vector3::new(0.3, 1.0, 0.0));
    let density = (0..grid.len()).map(|index| {
        let at = grid.centre(grid.voxel(index).map(|v| v as f64));
        let from_axis_mm = (at.coords - axis.into_inner() * at.coords.dot(&axis)).norm();
        (1.0 + 0.6 * ((12.0 - from_axis_mm) / 1.5 + 0.5).clamp(0.0, 1.0)) as f32
    });
    let density = density.collect();
    let water = Material::named("water").unwrap();
    VoxelPhantom::new(grid, vec![0; size.iter().product()], density, vec![water])
        .unwrap()
        .with_interpolation(interpolation)
}

/// Density steps of homogeneous slices show as a comb along the edges of the bone; with trilinear interpolation there is none.
#[test]
fn thick_slices_leave_no_comb() {
    let spectrum = Spectrum::monoenergetic(40.0).unwrap();
    let image = |slice_mm: f64, interpolation: Interpolation| {
        let phantom = tilted_bone(slice_mm, interpolation);
        let projection = frontal(120, 0.4);
        primary(&phantom, &spectrum, &projection, 2).unwrap()
    };
    let fine = image(0.275, Interpolation::Trilinear);
    let error = |image: &[f64]| {
        let squares = image.iter().zip(&fine).map(|(a, b)| (a / b - 1.0).powi(2));
        (squares.sum::<f64>() / image.len() as f64).sqrt()
    };
    let [nearest, trilinear] = [Interpolation::Nearest, Interpolation::Trilinear]
        .map(|interpolation| error(&image(3.3, interpolation)));
    println!("rms error of slices of 3.3 mm: {nearest:.4} homogeneous, {trilinear:.4} trilinear");
    assert!(trilinear < 0.25 * nearest, "{trilinear} {nearest}");
}
