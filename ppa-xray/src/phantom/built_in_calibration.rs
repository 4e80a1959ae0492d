//! The default calibration; `data/hu_calibration.toml` contains the same as an example, with its sources.

use crate::phantom::segment::{Composition, Constituent, Segment};

/// The segments, from low to high HU.
pub(super) fn segments() -> Vec<Segment> {
    let segment = |name: &str, from_hu, composition, density: &[[f32; 2]]| Segment {
        name: name.to_owned(),
        from_hu,
        composition,
        density: density.to_vec(),
    };
    let pure = |material: &str| Composition::Pure(material.to_owned());
    let mixture = |ends: [(&str, f32); 2]| {
        Composition::Mixture(ends.map(|(material, density_g_cm3)| Constituent {
            material: material.to_owned(),
            density_g_cm3,
        }))
    };
    let fat_to_muscle = mixture([("adipose", 0.9305), ("muscle", 1.0305)]);
    let bone = mixture([("soft_tissue", 1.0762), ("bone_cortical", 1.85)]);
    vec![
        segment("air", None, pure("air"), &[[-1000.0, 0.001_205]]),
        segment(
            "skin and air",
            Some(-800.0),
            pure("soft_tissue"),
            &[[-1000.0, 0.001_205], [-98.0, 0.9305]],
        ),
        segment(
            "fat to muscle",
            Some(-120.0),
            fat_to_muscle,
            &[[-1000.0, 0.001_205], [-98.0, 0.9305], [14.0, 1.0305]],
        ),
        segment(
            "muscle",
            Some(14.0),
            pure("muscle"),
            &[[14.0, 1.0305], [100.0, 1.0762]],
        ),
        segment(
            "bone",
            Some(100.0),
            bone,
            &[[100.0, 1.0762], [3071.0, 2.835]],
        ),
        segment("metal", Some(2800.0), pure("titanium"), &[[2800.0, 4.54]]),
    ]
}
