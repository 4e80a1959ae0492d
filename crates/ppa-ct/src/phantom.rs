//! Analytic phantoms: limbs built from signed-distance shapes, whose true shape is known everywhere.
//!
//! [`LowerLeg::p01`] is a right lower leg and foot of an average adult male, lying supine on a table
//! top with the toes up: tibia and fibula, a talus with a real trochlea in its mortise, the other
//! twenty-five bones of the foot, muscle, fat and skin. Every dimension is that of adult anatomy (means of
//! published CT and cadaver studies where there are any), but it is a phantom, not a person.
//!
//! Frame: `ct` (LPS, mm): x to the patient's left, which is medial for a right leg; y posterior, towards the table;
//! z proximal.
//!
//! ```
//! use ppa_ct::phantom::{LowerLeg, TableTop, Tissue};
//! let limb = LowerLeg::p01();
//! let centre = limb.truth().joint_centre;
//! assert_eq!(limb.tissue(&centre), Tissue::SoftTissue); // the cartilage of the ankle
//! let ct = limb.voxelise(4.0, TableTop::Present)?;
//! assert!(ct.hu().iter().any(|&hu| hu > 700.0));
//! # Ok::<(), ppa_ct::phantom::PhantomError>(())
//! ```

mod bone;
mod envelope;
mod hindfoot;
mod loft;
mod midfoot_forefoot;
mod parameters;
mod sdf;
mod tibia_fibula;
mod tissue;
mod truth;
mod voxelise;

#[cfg(test)]
mod tests;

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

use self::bone::Skeleton;
use self::envelope::Envelope;
use self::hindfoot::Mortise;
use self::parameters::Parameters;

pub use self::tissue::Tissue;
pub use self::truth::Truth;
pub use self::voxelise::{PhantomError, TableTop};

/// A lower leg and foot of known shape.
#[derive(Debug, Clone)]
pub struct LowerLeg {
    parameters: Parameters,
    /// Limb frame: origin at the joint centre, z along the tibial shaft, x and y as in `ct`.
    ct_from_limb: Isometry3<f64>,
    mortise: Mortise,
    skeleton: Skeleton,
    envelope: Envelope,
}

impl LowerLeg {
    /// Phantom P01: right lower leg and foot of an average adult male.
    pub fn p01() -> Self {
        Self::new(Parameters::p01())
    }

    fn new(parameters: Parameters) -> Self {
        let p = &parameters;
        let rise = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), p.leg_rise_rad);
        let ct_from_limb = Isometry3::from_parts(Translation3::from(p.joint_centre_ct_mm), rise);
        let mortise = Mortise::new(p);

        let talus = 0;
        let mut bones = vec![hindfoot::talus(p, &mortise)];
        let calcaneus = bones.len();
        bones.push(hindfoot::calcaneus(p, talus));
        let tibia = bones.len();
        bones.push(tibia_fibula::tibia(p, &mortise, talus));
        bones.push(tibia_fibula::fibula(p, &mortise, tibia, talus));
        midfoot_forefoot::append(
            &mut bones,
            p,
            &midfoot_forefoot::Hindfoot { talus, calcaneus },
        );

        let table_normal = ct_from_limb.inverse() * Vector3::y_axis();
        let envelope = Envelope::new(p, &mortise, table_normal);
        Self {
            ct_from_limb,
            mortise,
            skeleton: Skeleton::new(bones),
            envelope,
            parameters,
        }
    }

    fn limb_point(&self, p_ct: &Point3<f64>) -> Point3<f64> {
        self.ct_from_limb.inverse_transform_point(p_ct)
    }

    /// Signed distance from a point of the `ct` frame to the skin in mm, negative inside.
    ///
    /// Exact on the skin and to first order near it; farther away an estimate with the right sign.
    /// The leg continues proximally beyond what [`LowerLeg::voxelise`] shows.
    pub fn skin_distance_mm(&self, p: &Point3<f64>) -> f64 {
        self.envelope.skin_distance(&self.limb_point(p))
    }

    /// What lies at a point of the `ct` frame.
    pub fn tissue(&self, p: &Point3<f64>) -> Tissue {
        self.tissue_in_limb(&self.limb_point(p))
    }

    /// The anatomical name of the bone at a point of the `ct` frame, such as `"talus"`.
    pub fn bone(&self, p: &Point3<f64>) -> Option<&'static str> {
        let (bone, _) = self.skeleton.bone_at(&self.limb_point(p))?;
        Some(bone.name)
    }

    /// The numbers that a measurement on the voxelised phantom should find.
    pub fn truth(&self) -> Truth {
        Truth::of(self)
    }
}
