//! Small scenes shared by several tests.

use nalgebra::{Isometry3, Matrix3, Point3, Translation3, UnitQuaternion, Vector3};
use ppa_ct::Grid;
use ppa_xray::{
    Detector, FocalSpot, HeelEffect, Material, Projection, Source, Spectrum, SpotShape, TubeSpec,
    VoxelPhantom,
};

/// Device axes along the ct axes, source 1 m in front of the ct origin.
pub fn frontal(pixels: u32, pixel_mm: f64) -> Projection {
    Projection::new(
        Isometry3::translation(0.0, 0.0, -1_000.0),
        1_100.0,
        Detector::centred(pixels, pixels, pixel_mm),
    )
}

/// A water slab across the beam, centred on the ct origin.
pub fn slab(thickness_mm: f64, density_g_cm3: f32) -> VoxelPhantom {
    let size = [30, 30, 10];
    let spacing = Vector3::new(10.0, 10.0, thickness_mm / 10.0);
    let first = Point3::new(-145.0, -145.0, -0.45 * thickness_mm);
    let grid = Grid::axis_aligned(size, spacing, first).unwrap();
    let voxels = grid.len();
    let water = Material::named("water").unwrap();
    VoxelPhantom::new(
        grid,
        vec![0; voxels],
        vec![density_g_cm3; voxels],
        vec![water],
    )
    .unwrap()
}

/// A tilted limb of non-uniform density with bone and a titanium pin, in anisotropic voxels.
pub fn limb(pose: &Isometry3<f64>) -> VoxelPhantom {
    let size = [36, 30, 40];
    let tilt = Isometry3::from_parts(
        Translation3::identity(),
        UnitQuaternion::from_euler_angles(0.3, -0.2, 0.5),
    );
    let direction: Matrix3<f64> = (pose.rotation * tilt.rotation)
        .to_rotation_matrix()
        .into_inner();
    let spacing = Vector3::new(2.0, 2.5, 1.7);
    let half = Vector3::new(35.0, 36.25, 33.15);
    let origin = pose * tilt * Point3::from(-half);
    let grid = Grid::from_parts(size, direction, spacing, origin).unwrap();
    let (material, density) = (0..grid.len())
        .map(|index| {
            let [i, j, k] = grid.voxel(index);
            let (x, y) = (i as f64 * 2.0 - 35.0, j as f64 * 2.5 - 36.25);
            if x.hypot(y) > 33.0 {
                (0, 0.001_2)
            } else if (18..20).contains(&i) && (14..16).contains(&j) && (10..25).contains(&k) {
                (3, 4.5)
            } else if (x - 8.0).hypot(y) < 12.0 {
                (2, 1.2 + 0.05 * (k % 12) as f32)
            } else {
                (1, 0.95 + 0.01 * (k % 12) as f32)
            }
        })
        .unzip();
    let materials = ["air", "soft_tissue", "bone_cortical", "titanium"]
        .map(|name| Material::named(name).unwrap())
        .to_vec();
    VoxelPhantom::new(grid, material, density, materials).unwrap()
}

/// A focal spot of 8 mm behind blades at 200 mm, and a heel effect.
pub fn demanding_source() -> Source {
    Source::default()
        .with_focal_spot(
            FocalSpot::default()
                .with_size_mm(8.0)
                .with_shape(SpotShape::Gaussian),
        )
        .with_heel_effect(Some(HeelEffect::new(30.0)))
        .with_blades_mm(Some(200.0))
}

/// A tungsten tube at 60 kVp behind 2.5 mm of aluminium.
pub fn sixty_kvp() -> Spectrum {
    Spectrum::tungsten(&TubeSpec::new(60.0, 12.0, vec!["Al:2.5".parse().unwrap()])).unwrap()
}
