//! A scene for tests: quick to simulate, with every cause of uneven scatter.

use nalgebra::{Isometry3, Point3, Vector3};
use ppa_ct::Grid;

use crate::beam::detector::Detector;
use crate::beam::projection::Projection;
use crate::beam::spectrum::Spectrum;
use crate::beam::tube::TubeSpec;
use crate::matter::material::Material;
use crate::phantom::voxels::VoxelPhantom;

/// A limb of 6 cm with an eccentric bone and a titanium pin, 60 kVp, a detector of 12 cm.
pub(crate) fn exposure() -> (VoxelPhantom, Spectrum, Projection) {
    let size = [28, 28, 30];
    let first = Point3::new(-33.75, -33.75, -36.25);
    let grid = Grid::axis_aligned(size, Vector3::repeat(2.5), first).unwrap();
    let (material, density) = (0..grid.len())
        .map(|index| {
            let at = grid.centre(grid.voxel(index).map(|v| v as f64));
            if at.x.hypot(at.z) > 30.0 {
                (0, 0.001_2)
            } else if (at.x - 6.0).hypot(at.z - 14.0) < 2.6 && at.y.abs() < 20.0 {
                (3, 4.5)
            } else if (at.x - 6.0).hypot(at.z - 5.0) < 12.0 {
                (2, 1.6)
            } else {
                (1, 1.0)
            }
        })
        .unzip();
    let materials = ["air", "soft_tissue", "bone_cortical", "titanium"]
        .map(|name| Material::named(name).unwrap())
        .to_vec();
    let phantom = VoxelPhantom::new(grid, material, density, materials).unwrap();
    let spectrum = Spectrum::tungsten(&TubeSpec {
        kvp: 60.0,
        anode_angle_deg: 12.0,
        filters: vec!["Al:2.5".parse().unwrap()],
    })
    .unwrap();
    let pose = Isometry3::translation(0.0, 0.0, -1_000.0);
    let projection = Projection::new(pose, 1_100.0, Detector::centred(24, 24, 5.0));
    (phantom, spectrum, projection)
}
