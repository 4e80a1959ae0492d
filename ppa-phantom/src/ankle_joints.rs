//! Subchondral plates of the ankle and of the subtalar joint.
//!
//! Thicknesses are assumed within 0.5 to 1.5 mm. They vary with position: bone below the trochlea is densest on its medial
//! and its lateral side, or in one place (micro CT of ten tali, Surg Radiol Anat 2013;35:283).

use nalgebra::{Unit, Vector3};

use super::bone::Bone;
use super::hindfoot::Mortise;
use super::parameters::Parameters;
use super::subchondral::JointSurface;

/// Indices of the bones of both joints.
pub(super) struct AnkleBones {
    pub talus: usize,
    pub calcaneus: usize,
    pub tibia: usize,
    pub fibula: usize,
}

/// Adds the plates to both bones of each joint, as drawn in P01's size.
pub(super) fn add_plates(bones: &mut [Bone], p: &Parameters, mortise: &Mortise, of: &AnkleBones) {
    let along_mortise = |axis: Unit<Vector3<f64>>| mortise.limb_from_mortise * axis;
    let half_width_mm = 0.5 * p.trochlea_width_mm;
    let surface = |gap_mm, plate_mm, middle: [f64; 3], across, reach_mm| JointSurface {
        other: of.talus,
        gap_mm,
        plate_mm,
        middle: middle.into(),
        across,
        reach_mm,
    };
    let trochlea = surface(
        p.superior_gutter_mm,
        [1.0, 1.5],
        mortise.point(0.0, 0.0, 0.0),
        along_mortise(Vector3::x_axis()),
        half_width_mm,
    );
    let lateral_facet = surface(
        p.lateral_gutter_mm,
        [1.2, 0.9],
        mortise.point(-half_width_mm, 0.0, -9.0),
        along_mortise(Vector3::y_axis()),
        12.0,
    );
    // Thickest at the posterior facet, thin towards the sustentaculum and the anterior process.
    let subtalar = surface(
        p.small_joint_mm,
        [1.4, 0.9],
        [-8.0, 6.0, -28.0],
        Vector3::y_axis(),
        18.0,
    );
    for (other, surface) in [
        (of.tibia, trochlea),
        (of.fibula, lateral_facet),
        (of.calcaneus, subtalar),
    ] {
        let of_talus = JointSurface {
            other,
            ..surface.clone()
        };
        bones[of.talus].joints.push(of_talus);
        bones[other].joints.push(surface);
    }
}
