use ppa_core::random::Philox;
use ppa_ct::Grid;

use super::*;
use crate::engine::exposure::Exposure;
use crate::engine::small_limb;
use crate::matter::compton::ComptonModel;
use crate::phantom::voxels::VoxelPhantom;

/// A box of 100 x 80 x 72 mm and the beam of the small limb.
fn exposed(
    interpolation: Interpolation,
    of: impl Fn(Point3<f64>) -> (u8, f32),
    check: impl Fn(&Paths, &dyn Fn(u64) -> [Point3<f64>; 2]),
) {
    let (small, spectrum, projection) = small_limb::exposure();
    let corner = Point3::new(-50.0, -40.0, -40.0);
    let grid = Grid::axis_aligned([50, 40, 36], Vector3::repeat(2.0), corner).unwrap();
    let (material, density) = (0..grid.len())
        .map(|index| of(grid.centre(grid.voxel(index).map(|v| v as f64))))
        .unzip();
    let materials = small.materials().to_vec();
    let phantom = VoxelPhantom::new(grid, material, density, materials).unwrap();
    let phantom = phantom.with_interpolation(interpolation);
    let model = ComptonModel::default();
    let exposure = Exposure::new(&phantom, &spectrum, &projection, model).unwrap();
    let inverse = projection.ct_from_device.inverse();
    let corners = phantom.corners_ct().map(|corner| inverse * corner);
    // Ends of a path; some are outside the box.
    let ends = |index: u64| {
        let mut rng = Philox::new(5, 0, index);
        [(); 2].map(|()| {
            let [u, v, w] = [(); 3].map(|()| 1.6 * rng.unit() - 0.3);
            let along = |to: usize, share: f64| (corners[to] - corners[0]) * share;
            corners[0] + along(1, u) + along(2, v) + along(4, w)
        })
    };
    check(&Paths::new(&exposure.transport), &ends);
}

/// A ball of graded density in air.
fn ball(at: Point3<f64>) -> (u8, f32) {
    let from_mm = (at - Point3::new(-20.0, -10.0, -15.0)).norm();
    if from_mm < 18.0 {
        (1, 1.0 + 0.01 * from_mm as f32)
    } else {
        (0, 0.001_2)
    }
}

/// The ball, in blocks of 16 voxels of 2 mm, begins at most one block behind the computed z, and not before it.
#[test]
fn nothing_but_air_lies_below_the_nearest_z() {
    exposed(Interpolation::Trilinear, ball, |paths, _| {
        let device_from_ct = small_limb::exposure().2.ct_from_device.inverse();
        let centre = device_from_ct * Point3::new(-20.0, -10.0, -15.0);
        let nearest_mm = centre.z - 18.0;
        let found_mm = paths.nearest_z_mm();
        let diagonal_mm = 32.0 * 3.0_f64.sqrt();
        assert!(
            (nearest_mm - diagonal_mm - 2.0..=nearest_mm).contains(&found_mm),
            "{found_mm} {nearest_mm}"
        );
    });
    let air = |_| (0, 0.001_2);
    exposed(Interpolation::Trilinear, air, |paths, _| {
        assert_eq!(paths.nearest_z_mm(), f64::INFINITY);
    });
}

/// Masses of random paths, with uniform blocks in one step and cell by cell.
#[test]
fn uniform_blocks_change_no_path() {
    for interpolation in [Interpolation::Nearest, Interpolation::Trilinear] {
        exposed(interpolation, ball, |paths, ends| {
            let size = paths.blocks.size;
            let uniform =
                (0..size.iter().product()).filter(|&block| paths.blocks.code(block).is_some());
            assert!(uniform.count() > 0, "no uniform block in {size:?}");
            let without = Paths {
                blocks: Arc::new(UniformBlocks::mixed(size)),
                basis: paths.basis.clone(),
                coarse: paths.coarse.clone(),
                ..*paths
            };
            for index in 0..500 {
                let [from, to] = ends(index);
                let mut masses = [[[0.0; LANES]]; 2];
                paths.between(&from, &to, &mut masses[0]);
                without.between(&from, &to, &mut masses[1]);
                for (blocks, cells) in masses[0][0].iter().zip(masses[1][0]) {
                    assert!(
                        (blocks - cells).abs() < 2e-4,
                        "{from} to {to}: {blocks}, {cells}"
                    );
                }
            }
        });
    }
}

/// If the density is a linear function of the position, its value at the middle of a path is its mean.
#[test]
fn chords_of_a_linear_density_are_exact() {
    let density = |at: Point3<f64>| 1.0 + 0.004 * at.x - 0.007 * at.y + 0.003 * at.z;
    let of = |at: Point3<f64>| (1, density(at) as f32);
    exposed(Interpolation::Trilinear, of, |paths, ends| {
        let ct_from_device = small_limb::exposure().2.ct_from_device;
        let mut inside = 0;
        for index in 0..2_000 {
            let [from, to] = ends(index);
            // Both ends between centres of voxels.
            let within = [from, to].iter().all(|end| {
                let cell = paths.lattice.ray(end, &Vector3::zeros()).origin;
                let size = paths.lattice.size;
                (0..3).all(|axis| (0.5..size[axis] as f64 - 0.5).contains(&cell[axis]))
            });
            if !within {
                continue;
            }
            inside += 1;
            let mut mass = [[0.0; LANES]];
            paths.between(&from, &to, &mut mass);
            // All of it is one basis material or a mixture of them, so compare the attenuation at 60 keV with that of a gram.
            let per_gram = paths.basis.exponent(paths.basis.shares(1), 60.0);
            let found = f64::from(paths.basis.exponent(&mass, 60.0) / per_gram);
            let expected =
                (to - from).norm() * density(ct_from_device * nalgebra::center(&from, &to));
            assert!(
                (found / expected - 1.0).abs() < 3e-5,
                "{from} to {to}: {found} {expected}"
            );
        }
        assert!(inside > 50, "{inside} paths");
    });
}
