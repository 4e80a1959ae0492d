//! Analytic phantoms: limbs built from signed-distance shapes, with an exact ground truth everywhere.
//!
//! [`LowerLeg`] is a lower leg and foot, supine on a table top with the toes up: tibia and fibula, a talus with a real
//! trochlea in its mortise, the other twenty-five bones of the foot, two sesamoids, muscle, fat and skin. [`LowerLeg::p01`]
//! is that of an average adult man; P02 to P17 and any number of others by seed spread over published means and standard
//! deviations (`data/family.toml` names the sources). [`Limb::knee`] is another joint. These are phantoms, not persons:
//! correlations between dimensions in people are mostly unknown and left out.
//!
//! The same shape gives voxels ([`Limb::voxelise`], blurred and noisy through a [`Scanner`]), the skin and its normal, the tissues
//! along a ray ([`Limb::chords`]), labels of the bones, the joint gutters, and the true values of
//! measurements ([`LowerLeg::truth`]).
//!
//! Frame: `ct` (LPS, mm): x to the patient's left, which is medial for a right leg; y posterior, towards the table;
//! z proximal. A left limb is the mirror image, on the other side of x = 0.
//!
//! ```
//! use ppa_phantom::{LowerLeg, Side, TableTop, Tissue};
//! let limb = LowerLeg::family("P07", Side::Left)?;
//! let centre = limb.truth().joint_centre;
//! assert_eq!(limb.tissue(&centre), Tissue::SoftTissue); // the cartilage of the ankle
//! let ct = limb.voxelise(4.0, TableTop::Present)?;
//! assert!(ct.hu().iter().any(|&hu| hu > 700.0));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod ankle_joints;
mod bone;
mod bone_labels;
mod bounds;
mod contents;
mod draw;
mod envelope;
mod family;
mod family_table;
mod forefoot_table;
mod gutters;
mod hindfoot;
mod knee;
mod limb;
mod loft;
mod lower_leg;
mod lower_leg_skin;
mod lower_leg_skin_table;
mod midfoot_forefoot;
mod parameters;
mod physeal_scar;
mod placed;
mod placement;
mod plate;
mod rays;
mod scanner;
mod sdf;
mod section;
mod smooth;
mod subchondral;
mod table_list;
mod texture;
mod tibia_fibula;
mod tibia_fibula_table;
mod tissue;
mod trabeculae;
mod truth;
mod voxelise;

#[cfg(test)]
mod tests;

pub use ppa_core::Side;

pub use self::family::UnknownPhantom;
pub use self::gutters::{GutterPoint, Gutters};
pub use self::limb::Limb;
pub use self::lower_leg::LowerLeg;
pub use self::parameters::Sex;
pub use self::rays::{Chord, SkinHit};
pub use self::scanner::Scanner;
pub use self::tissue::Tissue;
pub use self::truth::Truth;
pub use self::voxelise::{PhantomError, TableTop};
