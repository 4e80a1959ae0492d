//! The iso-surface against derived answers.

use std::f64::consts::PI;

use nalgebra::{Affine3, Matrix3, Matrix4, Point3, Rotation3, Vector3};
use ppa_ct::{Grid, Volume};
use ppa_mesh::{Border, SurfaceError, iso_surface, iso_surfaces};
use proptest::prelude::*;

use crate::fields::{hash_noise, on_grid, volume};

fn ball(grid: Grid, centre: Point3<f64>, radius_mm: f64) -> Volume {
    on_grid(grid, |p| {
        (-500.0 - 100.0 * ((p - centre).norm() - radius_mm)) as f32
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]
    /// Oblique, sheared, anisotropic and left-handed lattices see the same ball with the same
    /// outward normals; chords err by at most h²/8R, h the largest diagonal of a cell.
    #[test]
    fn a_ball_is_a_ball_on_any_lattice(
        angles in prop::array::uniform3(-1.0..1.0_f64),
        spacing in prop::array::uniform3(0.8..2.5_f64),
        shear in -0.4..0.4_f64,
        mirrored in any::<bool>(),
    ) {
        let radius = 15.0;
        let mut scale = Matrix3::from_diagonal(&Vector3::from(spacing));
        scale[(1, 2)] = shear;
        if mirrored {
            scale.column_mut(0).neg_mut();
        }
        let linear = Rotation3::from_euler_angles(angles[0], angles[1], angles[2]) * scale;
        let size = spacing.map(|s| (44.0 / s) as usize);
        let middle = linear * Vector3::from(size.map(|n| 0.5 * (n - 1) as f64));
        let mut matrix = Matrix4::identity();
        matrix.fixed_view_mut::<3, 3>(0, 0).copy_from(&linear);
        matrix.fixed_view_mut::<3, 1>(0, 3).copy_from(&(-middle));
        let grid = Grid::new(size, Affine3::from_matrix_unchecked(matrix)).unwrap();
        let mesh = iso_surface(&ball(grid, Point3::origin(), radius), -500.0, Border::Open).unwrap();

        let topology = mesh.topology();
        prop_assert_eq!((topology.boundary_edges, topology.non_manifold_edges), (0, 0));
        prop_assert_eq!((topology.components, topology.euler), (1, 2));
        let sagitta = linear.column_sum().norm_squared().max(12.0) / (8.0 * radius);
        for (vertex, normal) in mesh.vertices.iter().zip(&mesh.normals) {
            let p = vertex.coords.cast::<f64>();
            prop_assert!((p.norm() - radius).abs() < sagitta);
            prop_assert!(normal.cast::<f64>().dot(&p.normalize()) > 0.995);
        }
        let volume = 4.0 / 3.0 * PI * radius.powi(3);
        prop_assert!((mesh.volume_mm3() / volume - 1.0).abs() < 3.0 * sagitta / radius);
    }

    /// Noise has every ambiguous case; integers make ties. Neither may open the surface, and the
    /// border closes flush with the outer faces of the voxels. Rows as long as words of bits, shorter and longer ones.
    #[test]
    fn closed_noise_has_no_boundary(
        seed in any::<u32>(),
        ties in any::<bool>(),
        nx in prop::sample::select(vec![6, 61, 62, 63, 130]),
    ) {
        let size = [nx, 7, 21];
        let noise = hash_noise(size.iter().product(), u64::from(seed));
        let value = |n: f64| if ties { (2.0 * n).round() } else { n };
        let field = volume(size, [1.0; 3], |p| {
            value(noise[p.x as usize + nx * (p.y as usize + 7 * p.z as usize)]) as f32
        });
        let mesh = iso_surface(&field, 0.0, Border::Closed).unwrap();
        let topology = mesh.topology();
        prop_assert_eq!(topology.boundary_edges, 0);
        prop_assert!(ties || topology.non_manifold_edges == 0);
        prop_assert!(mesh.volume_mm3() > 0.0);
        for [a, b, c] in &mesh.triangles {
            let corner = |v: &u32| mesh.vertices[*v as usize].cast::<f64>();
            let area = (corner(b) - corner(a)).cross(&(corner(c) - corner(a))).norm();
            prop_assert!(area > 0.0);
        }
        for (axis, n) in size.map(|n| n as f64).into_iter().enumerate() {
            let all = mesh.vertices.iter().map(|v| f64::from(v[axis]));
            prop_assert!(all.into_iter().all(|c| (-0.5..=n - 0.5).contains(&c)));
        }
    }
}

#[test]
fn a_voxel_at_the_iso_value_is_one_vertex() {
    // A ramp in x that meets the iso value exactly at the voxels i = 2.
    let field = volume([5, 6, 40], [1.0; 3], |p| (1000.0 * (2.0 - p.x)) as f32);
    let mesh = iso_surface(&field, 0.0, Border::Open).unwrap();
    assert_eq!(mesh.vertices.len(), 6 * 40);
    assert!(mesh.vertices.iter().all(|v| v.x == 2.0));
    assert!((mesh.area_mm2() - 5.0 * 39.0).abs() < 1e-9);
    assert!(
        mesh.normals
            .iter()
            .all(|n| (n - Vector3::x()).norm() < 1e-6)
    );
}

/// A voxel at the iso value in air has no surface; next to a body it leaves no vertex and no normal behind, wherever parts begin.
#[test]
fn a_lone_voxel_at_the_iso_value_is_nothing() {
    let body = |lone: &[[f64; 3]]| {
        volume([9, 9, 30], [1.0; 3], |p| {
            match lone.iter().any(|&at| *p == Point3::from(at)) {
                true => -500.0,
                // Its lower face runs through voxels at the iso value.
                false => {
                    (1000.0 - 250.0 * (p - Point3::new(4.0, 4.0, 15.0)).abs().max()) as f32 - 500.0
                }
            }
        })
    };
    let alone = iso_surface(&body(&[]), -500.0, Border::Open).unwrap();
    let lone = body(&[[1.0, 7.0, 2.0], [7.0, 1.0, 27.0], [4.0, 4.0, 5.0]]);
    for threads in [1, 2, 5] {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        let mesh = pool
            .install(|| iso_surface(&lone, -500.0, Border::Open))
            .unwrap();
        assert!(mesh == alone, "{threads} threads");
    }
    assert!(alone.normals.iter().all(|n| (n.norm() - 1.0).abs() < 1e-5));
}

/// A voxel slightly above the iso value 1.5 m from the origin, where f32 has steps of 0.12 µm: its six crossings stay apart.
#[test]
fn crossings_beside_a_voxel_stay_apart_far_from_the_origin() {
    for (origin_mm, spacing_mm) in [(0.0, 0.5), (1500.0, 0.5), (-20_000.0, 0.3)] {
        let place = Point3::from(Vector3::repeat(origin_mm));
        let grid = Grid::axis_aligned([3; 3], Vector3::repeat(spacing_mm), place).unwrap();
        let mut hu = vec![-1000.0; 27];
        hu[13] = -499.99;
        let mesh = iso_surface(&Volume::new(grid, hu).unwrap(), -500.0, Border::Open).unwrap();
        assert_eq!((mesh.vertices.len(), mesh.euler()), (6, 2));
        for (i, a) in mesh.vertices.iter().enumerate() {
            assert!(
                mesh.vertices[..i].iter().all(|b| a != b),
                "{origin_mm} mm: {a}"
            );
        }
    }
}

#[test]
fn a_full_volume_closes_to_its_own_box() {
    let field = volume([3, 4, 5], [1.0, 2.0, 3.0], |_| 40.0);
    let mesh = iso_surface(&field, -500.0, Border::Closed).unwrap();
    // Edges and corners of the box are cut by at most half a voxel.
    let volume = mesh.volume_mm3() / (3.0 * 8.0 * 15.0);
    assert!((0.8..1.0).contains(&volume), "{volume}");
    assert_eq!((mesh.euler(), mesh.boundary_edges()), (2, 0));
}

/// Whole HU in 16 bits and in floating point, one iso value after the other and all in one pass; iso
/// values on and between whole numbers.
#[test]
fn both_sample_types_and_one_pass_give_equal_surfaces() {
    let size = [70, 9, 40];
    let hu: Vec<i16> = hash_noise(size.iter().product(), 5)
        .iter()
        .map(|noise| (6.0 * noise) as i16)
        .collect();
    let grid = Grid::axis_aligned(size, Vector3::new(0.7, 0.8, 1.5), Point3::origin()).unwrap();
    let float = Volume::new(grid.clone(), hu.iter().map(|&v| v.into()).collect()).unwrap();
    let whole = Volume::from_i16(grid, hu).unwrap();
    let values = [0.0, -1.5, 2.0];
    for border in [Border::Open, Border::Closed] {
        let one_pass = iso_surfaces(&whole, &values, border).unwrap();
        for (surface, &iso) in one_pass.iter().zip(&values) {
            assert_eq!(surface, &iso_surface(&whole, iso, border).unwrap());
            assert_eq!(surface, &iso_surface(&float, iso, border).unwrap());
        }
    }
    let too_high = iso_surface(&whole, 40_000.0, Border::Open);
    assert!(matches!(too_high, Err(SurfaceError::Empty { .. })));
}

#[test]
fn threads_do_not_change_the_surface() {
    let noise = hash_noise(20 * 20 * 70, 3);
    // Whole values, so that some voxels equal the iso value and are vertices themselves.
    let field = volume([20, 20, 70], [1.0; 3], |p| {
        (8.0 * noise[p.x as usize + 20 * (p.y as usize + 20 * p.z as usize)]).round() as f32
    });
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| iso_surface(&field, 2.0, Border::Open).unwrap())
    };
    let one = with(1);
    for threads in [2, 3, 7, 100] {
        assert!(one == with(threads), "{threads} threads");
    }
}

#[test]
fn nothing_to_see_is_an_error_that_says_so() {
    let air = volume([4, 4, 4], [1.0; 3], |_| -1000.0);
    let error = iso_surface(&air, -500.0, Border::Closed).unwrap_err();
    assert!(matches!(
        error,
        SurfaceError::Empty {
            max_hu: -1000.0,
            ..
        }
    ));
    let slice = volume([4, 4, 1], [1.0; 3], |p| p.x as f32);
    assert_eq!(
        iso_surface(&slice, 1.0, Border::Open),
        Err(SurfaceError::TooThin([4, 4, 1]))
    );
    assert!(matches!(
        iso_surface(&air, f32::NAN, Border::Open),
        Err(SurfaceError::Iso(_))
    ));
}
