//! The knee.

use nalgebra::{Point3, Unit, Vector3};

use crate::*;

#[test]
fn the_knee_has_four_bones_apart_below_the_skin_on_the_table() {
    let knee = Limb::knee(Side::Right);
    let ct = knee.voxelise(2.0, TableTop::Present).unwrap();
    let labels = knee.bone_labels(ct.grid());
    let mut voxels = [0; 5];
    for label in &labels {
        voxels[usize::from(*label)] += 1;
    }
    assert_eq!(knee.bone_names(), ["femur", "tibia", "patella", "fibula"]);
    assert!(voxels.iter().all(|n| *n > 500), "{voxels:?}");
    let bones = knee.skeleton.bones().len();
    for index in (0..labels.len()).filter(|n| labels[*n] > 0) {
        let p = knee.limb_point(&ct.grid().centre(ct.grid().voxel(index).map(|v| v as f64)));
        let near = (0..bones).filter(|b| knee.skeleton.distance(*b, &p) < 0.5);
        assert_eq!(near.count(), 1, "bones meet at {p}");
        assert!(
            knee.envelope.skin_distance(&p) < -4.0,
            "bone at the skin at {p}"
        );
    }
    let joint = knee.ct_from_limb * Point3::origin();
    assert_eq!(
        knee.bone(&(joint + Vector3::new(22.0, 0.0, 15.0))),
        Some("femur")
    );
    assert_eq!(
        knee.bone(&(joint + Vector3::new(22.0, 0.0, -15.0))),
        Some("tibia")
    );
    // The joint space: femoral condyle, 4.5 mm, tibial plateau.
    let start = joint + Vector3::new(22.0, 6.0, 15.0);
    let down = Unit::new_unchecked(-Vector3::z());
    let chords = knee.chords(&start, &down, 40.0);
    let space = chords
        .iter()
        .find(|c| c.tissue == Tissue::SoftTissue)
        .unwrap();
    assert!((space.length_mm() - 4.5).abs() < 0.6, "{chords:?}");
    let left = Limb::knee(Side::Left);
    let mirror = |p: Point3<f64>| Point3::new(-p.x, p.y, p.z);
    assert_eq!(
        left.bone(&mirror(joint + Vector3::new(22.0, 0.0, 15.0))),
        Some("femur")
    );
}
