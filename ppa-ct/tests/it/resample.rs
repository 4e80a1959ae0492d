//! Volumes on other lattices, compared with fields whose values are known everywhere.

use std::f64::consts::TAU;

use nalgebra::{Affine3, Matrix3, Matrix4, Point3, Rotation3, Vector3};
use ppa_ct::{Grid, Interpolation, Volume, VolumeError};
use proptest::prelude::*;

use Interpolation::{Cubic, Linear, Nearest};

fn sampled(grid: &Grid, field: impl Fn(&Point3<f64>) -> f64) -> Volume {
    let centre = |n| grid.centre(grid.voxel(n).map(|v| v as f64));
    let hu = (0..grid.len()).map(|n| field(&centre(n)) as f32).collect();
    Volume::new(grid.clone(), hu).unwrap()
}

fn upright_grid(size: [usize; 3], spacing_mm: [f64; 3]) -> Grid {
    Grid::axis_aligned(
        size,
        Vector3::from(spacing_mm),
        Point3::new(-7.0, 11.0, 3.0),
    )
    .unwrap()
}

/// A rotated lattice whose k axis leans.
fn sheared_grid(size: [usize; 3], angles: [f64; 3], lean: [f64; 2]) -> Grid {
    let turn = Rotation3::from_euler_angles(angles[0], angles[1], angles[2]);
    let shear = Matrix3::new(1.0, 0.0, lean[0], 0.0, 1.2, lean[1], 0.0, 0.0, 2.0);
    let mut matrix: Matrix4<f64> = (turn.matrix() * shear).to_homogeneous();
    matrix[(0, 3)] = 5.0;
    Grid::new(size, Affine3::from_matrix_unchecked(matrix)).unwrap()
}

/// Largest difference from a field at the voxels at least `margin_mm` inside the box of `within`.
fn worst(volume: &Volume, within: &Grid, margin: f64, field: impl Fn(&Point3<f64>) -> f64) -> f64 {
    let grid = volume.grid();
    let here_from_ct = within.voxel_from_ct();
    let mut worst = 0.0_f64;
    let mut seen = 0;
    for n in 0..grid.len() {
        let centre = grid.centre(grid.voxel(n).map(|v| v as f64));
        let place = here_from_ct * centre;
        let inside = (0..3).all(|axis| {
            let last = (within.size()[axis] - 1) as f64;
            (margin..=last - margin).contains(&place[axis])
        });
        if inside {
            worst = worst.max((f64::from(volume.hu()[n]) - field(&centre)).abs());
            seen += 1;
        }
    }
    assert!(seen > 0, "no voxel lies inside");
    worst
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// Constant fields everywhere, linear ones between the centres, on any pair of lattices.
    #[test]
    fn linear_fields_stay_themselves(
        angles in prop::array::uniform3(-3.0..3.0_f64),
        lean in prop::array::uniform2(-0.8..0.8_f64),
        other in prop::array::uniform3(-3.0..3.0_f64),
        slope in prop::array::uniform3(-30.0..30.0_f64),
        how in prop::sample::select(vec![Linear, Cubic]),
    ) {
        let field = |p: &Point3<f64>| 20.0 + Vector3::from(slope).dot(&p.coords);
        let grid = sheared_grid([9, 8, 7], angles, lean);
        let volume = sampled(&grid, field);
        let middle = grid.centre([4.0, 3.5, 3.0]);
        let turn = Rotation3::from_euler_angles(other[0], other[1], other[2]);
        let fine = Grid::from_parts([7; 3], *turn.matrix(), Vector3::repeat(0.3), middle).unwrap();
        let found = volume.resampled_to(&fine, how, -1000.0).unwrap();
        prop_assert!(worst(&found, &grid, 0.0, field) < 2e-3);

        let flat = sampled(&grid, |_| 37.0).resampled(Vector3::new(0.7, 2.5, 5.0), how).unwrap();
        prop_assert!(flat.hu().iter().all(|v| (v - 37.0).abs() < 1e-4));
    }

    /// Keys' kernel with a = −1/2 reproduces polynomials of second degree.
    #[test]
    fn cubic_interpolation_is_exact_for_quadratics(
        c in prop::collection::vec(-1.0..1.0_f64, 6),
        spacing in prop::array::uniform3(0.2..0.9_f64),
    ) {
        let field = |p: &Point3<f64>| {
            let q = p - Point3::new(-2.0, 16.0, 8.0);
            c[0] * q.x * q.x + c[1] * q.y * q.y + c[2] * q.z * q.z
                + c[3] * q.x * q.y + c[4] * q.y * q.z + c[5] * q.x * q.z
        };
        let grid = upright_grid([9, 9, 9], [1.1, 0.9, 1.3]);
        let fine = sampled(&grid, field).resampled(Vector3::from(spacing), Cubic).unwrap();
        prop_assert!(worst(&fine, &grid, 1.0, field) < 1e-3);
        // The check can fail: linear interpolation is not exact for quadratics.
        prop_assume!(c[0].abs() > 0.5);
        let linear = sampled(&grid, field).resampled(Vector3::from(spacing), Linear).unwrap();
        prop_assert!(worst(&linear, &grid, 1.0, field) > 1e-3);
    }

    /// A coarse volume contains the same tissue: blocks of `factor` voxels, each with the mean around it.
    #[test]
    fn coarsening_keeps_the_mean(
        values in prop::collection::vec(-1000.0..1500.0_f32, 12 * 12 * 12),
        factor in 2..4_usize,
        how in prop::sample::select(vec![Linear, Cubic]),
    ) {
        // Noise only in the middle, so that the faces cut none of it.
        let grid = upright_grid([36; 3], [0.5, 0.7, 0.9]);
        let mut hu = vec![0.0; grid.len()];
        for (n, value) in values.iter().enumerate() {
            let [i, j, k] = [n % 12, n / 12 % 12, n / 144].map(|v| v + 12);
            hu[grid.index([i, j, k])] = *value;
        }
        let mean = |v: &Volume| v.hu().iter().map(|h| f64::from(*h)).sum::<f64>() / v.hu().len() as f64;
        let fine = Volume::new(grid.clone(), hu).unwrap();
        let coarse = fine.resampled(grid.spacing_mm() * factor as f64, how).unwrap();
        prop_assert_eq!(coarse.grid().size(), [36 / factor; 3]);
        // Noise of 700 HU in 1/27 of the volume: what aliases back to frequency 0 is below
        // 1 % of it (the low-pass leaves 0.7 % at the coarse sampling frequency).
        prop_assert!((mean(&coarse) - mean(&fine)).abs() < 0.5, "{} {}", mean(&coarse), mean(&fine));
    }

    /// Axes in any order and direction only reorder the same voxels.
    #[test]
    fn permuted_and_turned_axes_permute_the_voxels(
        order in Just([0, 1, 2]).prop_shuffle(),
        turned in prop::array::uniform3(any::<bool>()),
        how in prop::sample::select(vec![Nearest, Linear, Cubic]),
    ) {
        let grid = upright_grid([4, 5, 6], [1.0, 1.5, 2.5]);
        let volume = sampled(&grid, |p| (p.x * 1.7 + p.y * p.z).sin() * 800.0);
        let mut matrix = Matrix4::identity();
        let mut first = [0.0; 3];
        for (to, &from) in order.iter().enumerate() {
            let column = grid.ct_from_voxel().matrix().column(from).into_owned();
            matrix.set_column(to, &if turned[from] { -column } else { column });
            first[from] = if turned[from] { (grid.size()[from] - 1) as f64 } else { 0.0 };
        }
        matrix.fixed_view_mut::<3, 1>(0, 3).copy_from(&grid.centre(first).coords);
        let other = Grid::new(order.map(|a| grid.size()[a]), Affine3::from_matrix_unchecked(matrix)).unwrap();
        let found = volume.resampled_to(&other, how, f32::NAN).unwrap();
        for n in 0..other.len() {
            let place = grid.voxel_from_ct() * other.centre(other.voxel(n).map(|v| v as f64));
            let voxel = [0, 1, 2].map(|axis| place[axis].round() as usize);
            prop_assert!((found.hu()[n] - volume.at(voxel)).abs() < 1e-3);
        }
        // Its axes are reported in the order of the body directions.
        for (direction, (axis, against)) in other.lps_axes().into_iter().enumerate() {
            prop_assert_eq!((order[axis], against), (direction, turned[direction]));
        }
    }
}

/// Amplitude of a wave along x after resampling to voxels three times as long.
fn amplitude_after_coarsening(cycles_per_voxel: f64, how: Interpolation) -> f64 {
    let grid = upright_grid([240, 3, 3], [1.0; 3]);
    let wave = |p: &Point3<f64>| 1000.0 * (TAU * cycles_per_voxel * (p.x + 7.0) + 0.4).sin();
    let coarse = sampled(&grid, wave)
        .resampled(Vector3::new(3.0, 1.0, 1.0), how)
        .unwrap();
    let row = &coarse.hu()[..coarse.grid().size()[0]];
    let middle = &row[10..row.len() - 10];
    middle
        .iter()
        .fold(0.0_f64, |m, v| m.max(f64::from(v.abs())))
        / 1000.0
}

/// The new Nyquist frequency is a sixth of a cycle per voxel. A Gaussian of variance
/// (3² − 1)/4 passes exp(−2π² f² · 2): 0.96 at 0.03, 0.085 at 0.25 and 0.0018 at 0.4 cycles.
#[test]
fn waves_that_the_coarse_lattice_cannot_hold_are_suppressed() {
    for how in [Linear, Cubic] {
        assert!(amplitude_after_coarsening(0.03, how) > 0.93);
        assert!(amplitude_after_coarsening(0.25, how) < 0.10);
        assert!(amplitude_after_coarsening(0.40, how) < 0.004);
    }
    // Without low-pass they alias.
    assert!(amplitude_after_coarsening(0.40, Nearest) > 0.9);
}

#[test]
fn a_tilted_stack_becomes_upright() {
    let grid = sheared_grid([40, 36, 20], [0.2, -0.4, 0.9], [0.0, 0.6]);
    assert!((grid.tilt_deg() - 0.3_f64.atan().to_degrees()).abs() < 1e-9);
    let middle = grid.centre([19.5, 17.5, 9.5]);
    let ball = |p: &Point3<f64>| (14.0 - (p - middle).norm()).clamp(-4.0, 4.0) * 130.0 - 480.0;
    let volume = sampled(&grid, ball);
    for how in [Nearest, Linear, Cubic] {
        let upright = volume.upright(how, -1000.0).unwrap();
        let axes = upright.grid().direction();
        assert!((axes.tr_mul(&axes) - Matrix3::identity()).amax() < 1e-12);
        assert_eq!(upright.grid().size()[2], 20, "slices stay in their planes");
        for n in 0..grid.len() {
            let centre = grid.centre(grid.voxel(n).map(|v| v as f64));
            let place = upright.grid().voxel_from_ct() * centre;
            let inside = (0..3).all(|axis| {
                (-1e-6..=(upright.grid().size()[axis] - 1) as f64 + 1e-6).contains(&place[axis])
            });
            assert!(inside, "voxel {n} was left out: {place}");
        }
        // The field bends only where the ball's edge is clamped.
        let off = worst(&upright, &grid, 1.0, ball);
        let allowed = if how == Nearest { 100.0 } else { 40.0 };
        assert!(off < allowed, "{how:?}: {off} HU");
        let corner = upright.grid().size().map(|n| n - 1);
        assert!(upright.at([0; 3]) == -1000.0 || upright.at(corner) == -1000.0);
    }
    let square = sampled(&upright_grid([3, 4, 5], [1.0; 3]), |p| p.x);
    assert_eq!(square.upright(Linear, 0.0).unwrap(), square);
}

/// Slices that are whole voxels apart are only moved: each value is unchanged.
#[test]
fn an_upright_stack_is_as_sharp_as_the_tilted_one() {
    let mut matrix = Matrix4::from_diagonal(&nalgebra::Vector4::new(0.5, 0.5, 2.0, 1.0));
    matrix[(1, 2)] = 1.5; // three voxels along j from slice to slice, 37 degrees
    let grid = Grid::new([6, 9, 5], Affine3::from_matrix_unchecked(matrix)).unwrap();
    let hu = (0..grid.len()).map(|n| (n * 7919 % 2003) as f32).collect();
    let tilted = Volume::new(grid.clone(), hu).unwrap();
    for how in [Nearest, Linear, Cubic] {
        let upright = tilted.upright(how, -1000.0).unwrap();
        assert_eq!(upright.grid().size(), [6, 9 + 3 * 4, 5]);
        for n in 0..grid.len() {
            let [i, j, k] = grid.voxel(n);
            assert_eq!(upright.at([i, j + 3 * k, k]), tilted.hu()[n], "{how:?}");
        }
        let air = upright.hu().iter().filter(|v| **v == -1000.0).count();
        assert_eq!(air, upright.grid().len() - grid.len());
    }
}

#[test]
fn labels_stay_labels_and_the_same_lattice_changes_nothing() {
    let grid = upright_grid([7, 6, 5], [0.8, 0.8, 3.0]);
    let labels = sampled(&grid, |p| {
        ((p.x * 3.1 + p.y * 1.7 + p.z).floor() as i64).rem_euclid(3) as f64
    });
    for spacing in [0.5, 1.9] {
        let other = labels.resampled(Vector3::repeat(spacing), Nearest).unwrap();
        assert!(other.hu().iter().all(|v| [0.0, 1.0, 2.0].contains(v)));
    }
    for how in [Nearest, Linear, Cubic] {
        assert_eq!(
            labels.resampled(grid.spacing_mm(), how).unwrap().hu(),
            labels.hu()
        );
    }
}

#[test]
fn threads_do_not_change_a_bit() {
    let grid = sheared_grid([30, 20, 10], [0.1, 0.2, 0.3], [0.2, -0.3]);
    let volume = sampled(&grid, |p| {
        (p.x * 2.0 + p.y).sin() * (p.z * 1.3).cos() * 900.0
    });
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| {
            volume
                .resampled(Vector3::new(1.9, 0.6, 3.3), Cubic)
                .unwrap()
        })
    };
    assert_eq!(with(1), with(4));
}

#[test]
fn spacings_that_are_none_are_refused() {
    let volume = sampled(&upright_grid([4; 3], [1.0; 3]), |p| p.x);
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let refused = volume.resampled(Vector3::new(1.0, bad, 1.0), Linear);
        assert!(matches!(refused, Err(VolumeError::Spacing(_))), "{bad}");
    }
    let refused = volume.resampled(Vector3::repeat(1e-4), Linear);
    assert!(matches!(refused, Err(VolumeError::TooFine { .. })));
    for coarse in [8.1, 1e300] {
        let refused = volume.resampled(Vector3::new(1.0, 1.0, coarse), Linear);
        assert!(matches!(
            refused,
            Err(VolumeError::TooCoarse { side_mm: 4.0, .. })
        ));
    }
    // A spacing somewhat longer than the volume leaves one voxel at its centre.
    let one = volume.resampled(Vector3::repeat(7.9), Linear).unwrap();
    assert_eq!(one.grid().size(), [1; 3]);
    assert!((one.grid().origin_mm() - volume.grid().centre([1.5; 3])).norm() < 1e-9);
}

/// A low-pass as wide as the volume preserves its mean, however wide.
#[test]
fn a_lattice_coarser_than_the_volume_sees_its_mean() {
    let grid = upright_grid([4000, 2, 1], [0.5, 1.0, 1.0]);
    let first_quarter = |p: &Point3<f64>| if p.x < 493.0 { 1000.0 } else { -1000.0 };
    let volume = sampled(&grid, first_quarter);
    let middle = grid.centre([1999.5, 0.5, 0.0]);
    for spacing_mm in [1e5, 1e9, 1e18] {
        let coarse = Grid::axis_aligned([1, 1, 1], Vector3::repeat(spacing_mm), middle).unwrap();
        let mean = volume
            .resampled_to(&coarse, Linear, 0.0)
            .unwrap()
            .at([0; 3]);
        assert!((mean + 500.0).abs() < 0.01, "{spacing_mm}: {mean}");
    }
}

#[test]
fn voxels_that_no_memory_holds_are_an_error() {
    let volume = sampled(&upright_grid([3, 3, 3], [1.0; 3]), |p| p.x);
    let endless = upright_grid([1 << 20; 3], [1e-6; 3]);
    let refused = volume.resampled_to(&endless, Linear, 0.0);
    assert_eq!(refused, Err(VolumeError::Memory { voxels: 1 << 60 }));
}
