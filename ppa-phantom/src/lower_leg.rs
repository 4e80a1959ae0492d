//! Lower leg and foot.

use std::ops::Deref;

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use ppa_core::Side;

use super::ankle_joints::{self, AnkleBones};
use super::bone::Skeleton;
use super::family::{self, UnknownPhantom};
use super::hindfoot::Mortise;
use super::limb::{Limb, ScanRange};
use super::lower_leg_skin::{self, Rest};
use super::parameters::{P01, Parameters, Sex};
use super::placement::Placement;
use super::plate::Plate;
use super::sdf::{Plane, Shape};
use super::texture::Texture;
use super::trabeculae::MARROW_HU;
use super::{hindfoot, midfoot_forefoot, tibia_fibula};

/// A lower leg and foot of known shape; dereferences to its [`Limb`].
#[derive(Debug, Clone)]
pub struct LowerLeg {
    pub(super) parameters: Parameters,
    pub(super) limb: Limb,
    pub(super) mortise: Mortise,
    /// Motion of the foot against the leg, with its size.
    pub(super) foot_placement: Placement,
}

impl Deref for LowerLeg {
    type Target = Limb;

    fn deref(&self) -> &Limb {
        &self.limb
    }
}

/// Indices of the bones, in the order in which they are built.
pub(super) const TALUS: usize = 0;
pub(super) const CALCANEUS: usize = 1;
pub(super) const TIBIA: usize = 2;
pub(super) const FIBULA: usize = 3;

impl LowerLeg {
    /// Phantom P01: right lower leg and foot of an average adult male.
    pub fn p01() -> Self {
        Self::new(P01, Side::Right)
    }

    /// Phantom P01 to P17: nine of men's and eight of women's dimensions, mortise angles from 10° to 29°.
    ///
    /// The other foot of the same phantom is the mirror image with every dimension off by about 1 %, and spongy bone of its own.
    ///
    /// # Errors
    /// [`UnknownPhantom`] unless `name` is `"P01"` to `"P17"`, in upper or lower case.
    pub fn family(name: &str, side: Side) -> Result<Self, UnknownPhantom> {
        Ok(Self::new(family::named(name, side)?, side))
    }

    /// Draws a phantom around the published averages by seed; each dimension is within two standard deviations.
    ///
    /// Size scales all lengths together. Correlations of the other dimensions in people are unknown, so these
    /// are drawn independently.
    pub fn from_seed(seed: u64, side: Side) -> Self {
        Self::new(family::of_seed(seed, side), side)
    }

    pub(super) fn new(parameters: Parameters, side: Side) -> Self {
        let p = &parameters.drawn();
        let size = parameters.size;
        let drawn_mortise = Mortise::new(p);
        let flexion = drawn_mortise.flexion(p);
        let resized = Placement::from_scaling(size);
        let foot_placement = resized * flexion;
        let rest = Rest::new(&parameters, &foot_placement);
        let rise = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), rest.rise_rad);
        let ct_from_limb =
            Isometry3::from_parts(Translation3::from(parameters.joint_centre_ct_mm), rise);

        let mut bones = vec![
            hindfoot::talus(p, &drawn_mortise),
            hindfoot::calcaneus(p, TALUS),
            tibia_fibula::tibia(p, &drawn_mortise, &flexion, TALUS),
            tibia_fibula::fibula(p, &drawn_mortise, &flexion, [TALUS, CALCANEUS, TIBIA]),
        ];
        let hindfoot = midfoot_forefoot::Hindfoot {
            talus: TALUS,
            calcaneus: CALCANEUS,
        };
        midfoot_forefoot::append(&mut bones, p, &hindfoot);
        let ankle = AnkleBones {
            talus: TALUS,
            calcaneus: CALCANEUS,
            tibia: TIBIA,
            fibula: FIBULA,
        };
        ankle_joints::add_plates(&mut bones, p, &drawn_mortise, &ankle);
        let bones = bones.iter().enumerate().map(|(index, bone)| {
            let leg = [TIBIA, FIBULA].contains(&index);
            bone.placed(if leg { &resized } else { &foot_placement })
        });

        let table = Shape::HalfSpace(Plane {
            normal: ct_from_limb.inverse() * Vector3::y_axis(),
            offset: rest.depth_mm,
        });
        let placements = [&resized, &foot_placement];
        let envelope = lower_leg_skin::envelope(p, &drawn_mortise, placements, table);
        let top = parameters.leg_length_mm;
        let limb = Limb {
            side,
            ct_from_limb,
            skeleton: Skeleton::new(bones.collect()),
            envelope,
            plate: None,
            scan: ScanRange {
                low: [-100.0, -260.0, -150.0],
                high: [100.0, 100.0, top],
                cut: [None, Some(top)],
            },
            table_top_y: ct_from_limb.translation.y + rest.depth_mm,
            texture_share: parameters.trabecular_texture_hu
                / (parameters.trabecular_hu - MARROW_HU),
            texture: Texture::new(parameters.texture_seed),
        };
        Self {
            mortise: Mortise::new(&parameters),
            foot_placement,
            limb,
            parameters,
        }
    }

    /// The same leg with a titanium plate and five screws on the fibula, as after a fracture above the ankle.
    pub fn with_plate(mut self) -> Self {
        let fibula = &self.limb.skeleton.bones()[FIBULA].solid;
        let plate = Plate::on_fibula(fibula, &self.mortise, self.parameters.size);
        self.limb.envelope.parts.push(plate.bulge());
        self.limb.plate = Some(plate);
        self
    }

    /// Returns the limb without the dimensions of its ankle.
    pub fn into_limb(self) -> Limb {
        self.limb
    }

    /// Sex whose averages the dimensions are drawn around.
    pub fn sex(&self) -> Sex {
        self.parameters.sex
    }

    /// Plane of the medial facet of the talus, limb frame.
    pub(super) fn medial_facet(&self) -> Plane {
        self.mortise
            .medial_facet(&self.parameters)
            .placed(&self.flexion())
    }

    /// Plane of the lateral facet of the talus, limb frame.
    pub(super) fn lateral_facet(&self) -> Plane {
        self.mortise
            .lateral_facet(&self.parameters)
            .placed(&self.flexion())
    }

    /// Rotation of the talus from a right angle between foot and leg.
    pub(super) fn flexion(&self) -> Placement {
        self.mortise.flexion(&self.parameters)
    }

    /// Distance from the joint centre to the standing plane.
    pub(super) fn sole_depth_mm(&self) -> f64 {
        -lower_leg_skin::sole()
            .placed(&self.foot_placement)
            .distance(&Point3::origin())
    }
}
