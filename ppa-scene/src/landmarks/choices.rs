//! User choices for a limb, and errors of landmarks.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::landmarks::found::{AxisSource, Landmarks};
use crate::landmarks::limb_kind::{Joint, LimbKind};

/// User choices that replace the automatic ones; `None` keeps the automatic choice.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LandmarkOverrides {
    /// Kind of limb; by default a lower leg if an ankle is found, otherwise a knee if one is.
    pub limb: Option<LimbKind>,
    /// The joint centre, `ct` frame, mm; the axis is moved parallel to itself to pass through it.
    pub joint_centre: Option<[f64; 3]>,
    /// Start and end of the joint region, mm proximal to the joint level; below 0, distal to a knee.
    pub joint_region: Option<[f64; 2]>,
    /// The same for the calf region.
    pub calf_region: Option<[f64; 2]>,
    /// Source of the region centres.
    pub axis_source: Option<AxisSource>,
    /// Two points that the axis runs through, `ct` frame, mm, instead of the regions' centres. The joint
    /// is then the point of this axis nearest to [`Self::joint_centre`], or at the joint's level.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub axis: Option<[[f64; 3]; 2]>,
    /// The direction that faces up at angle 0, `ct` frame.
    pub anterior: Option<[f64; 3]>,
    /// One distal and two proximal points of Π_P, `ct` frame, mm.
    pub plane_points: Option<[[f64; 3]; 3]>,
}

impl Landmarks {
    /// The found values of the choices that are still open besides the `given` ones: keys that exclude a given one are left out.
    pub fn open_choices(&self, given: &LandmarkOverrides) -> LandmarkOverrides {
        let by_regions = given.axis.is_none();
        let by_axis = given.joint_region.is_none()
            && given.calf_region.is_none()
            && given.axis_source.is_none();
        let joint = Vector3::from(self.joint_centre);
        let along = Vector3::from(self.axis_direction);
        let axis = [joint, joint + along * 100.0].map(Into::into);
        LandmarkOverrides {
            limb: open(given.limb, self.limb),
            joint_centre: open(given.joint_centre, self.joint_centre),
            joint_region: open(given.joint_region, self.joint_region.range_mm)
                .filter(|_| by_regions),
            calf_region: open(given.calf_region, self.calf_region.range_mm).filter(|_| by_regions),
            axis_source: open(given.axis_source, self.axis_source).filter(|_| by_regions),
            axis: open(given.axis, axis).filter(|_| by_axis),
            anterior: open(given.anterior, self.anterior),
            plane_points: open(given.plane_points, self.plane_points),
        }
    }
}

/// The found value if none is given.
fn open<T>(given: Option<T>, found: T) -> Option<T> {
    given.is_none().then_some(found)
}

impl LandmarkOverrides {
    /// Rejects numbers that are not finite, regions that run backwards and a front without
    /// direction.
    pub(crate) fn check(&self) -> Result<(), LandmarkError> {
        let by_regions = [
            ("joint_region", self.joint_region.is_some()),
            ("calf_region", self.calf_region.is_some()),
            ("axis_source", self.axis_source.is_some()),
        ];
        match (self.axis, by_regions.into_iter().find(|(_, given)| *given)) {
            (Some(_), Some((other, _))) => return Err(LandmarkError::AxisTwice { other }),
            (None, _) if self.axis_source == Some(AxisSource::Given) => {
                return Err(LandmarkError::NoAxis);
            }
            _ => {}
        }
        let [a, b, c] = self.plane_points.unwrap_or_default().map(Some);
        let [from, to] = self.axis.unwrap_or_default().map(Some);
        let points = [
            ("axis", from),
            ("axis", to),
            ("joint_centre", self.joint_centre),
            ("anterior", self.anterior),
            ("plane_points", a),
            ("plane_points", b),
            ("plane_points", c),
        ];
        for (name, point) in points {
            if let Some(found) = point.filter(|p| !p.iter().all(|c| c.is_finite())) {
                return Err(LandmarkError::Override {
                    name,
                    found,
                    expected: "three finite numbers",
                });
            }
        }
        let regions = [
            ("joint region", self.joint_region),
            ("calf region", self.calf_region),
        ];
        for (name, region) in regions {
            if let Some([from_mm, to_mm]) =
                region.filter(|[from, to]| from.is_nan() || to.is_nan() || from > to)
            {
                return Err(LandmarkError::Region {
                    name,
                    from_mm,
                    to_mm,
                    problem: "runs backwards, expected from <= to",
                });
            }
        }
        match self.anterior {
            Some(found) if Vector3::from(found).norm() < 1e-9 => Err(LandmarkError::Override {
                name: "anterior",
                found,
                expected: "a direction of length above 0",
            }),
            _ => Ok(()),
        }
    }
}

/// Why the landmarks of a limb cannot be found.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LandmarkError {
    /// The scan cannot be cut across a limb that is oblique in it.
    #[error("the scan cannot be cut across the limb's shaft")]
    Reslice(#[from] ppa_ct::VolumeError),
    /// The mask is not one value per voxel.
    #[error("the limb mask has {found} values, expected {expected}, one per voxel")]
    MaskLength {
        /// Values given.
        found: usize,
        /// Voxels of the volume.
        expected: usize,
    },
    /// There is no limb.
    #[error(
        "the limb has {} and {}, expected both above 0",
        ppa_core::text::count(*voxels, "voxel"), ppa_core::text::count(*vertices, "surface point")
    )]
    Empty {
        /// Voxels in the mask.
        voxels: usize,
        /// Vertices of the mesh.
        vertices: usize,
    },
    /// A vertex of the skin is NaN or infinite.
    #[error("vertex {vertex} of the limb's skin is not finite")]
    NotFinite {
        /// Its index.
        vertex: usize,
    },
    /// A lower leg was requested but shows no ankle.
    #[error(
        "no ankle found: no tibia and fibula that widen to a joint gap; give the joint centre, \
         or the limb kind \"other\""
    )]
    NoAnkle,
    /// A knee was requested but none is found.
    #[error(
        "no knee found: no femoral condyles with a notch between them above a joint gap and a tibial plateau; give the \
         joint centre, or the limb kind \"other\""
    )]
    NoKnee,
    /// One joint was requested, but the limb shows the other one.
    #[error(
        "no {asked} found, but the {found} is near {:.0}, {:.0}, {:.0} mm (LPS): give --limb {}, or the centre of the \
         {asked} with --joint", at_mm[0], at_mm[1], at_mm[2], limb_of(*found)
    )]
    OtherJoint {
        /// Requested joint.
        asked: Joint,
        /// Joint found.
        found: Joint,
        /// Its centre, `ct` frame.
        at_mm: [f64; 3],
    },
    /// Nothing was requested and neither joint is found.
    #[error(
        "neither an ankle (tibia and fibula that widen to a gap above the talus) nor a knee (condyles, gap and tibial \
         plateau) found: give the joint centre with --joint, or --limb other to rotate the limb about the middle of its length"
    )]
    NoJoint,
    /// The scan ends too close to a knee on both sides.
    #[error(
        "the limb reaches {distal_mm:.0} mm distal and {proximal_mm:.0} mm proximal of the knee, expected at least \
         {expected_mm:.0} mm of a shaft on one side, or half of that on both; give joint region and calf region"
    )]
    ShortKnee {
        /// Length below the joint level.
        distal_mm: f64,
        /// Length above it.
        proximal_mm: f64,
        /// Length needed on one side.
        expected_mm: f64,
    },
    /// The scan ends too close to the joint.
    #[error(
        "the limb reaches {:.0} mm proximal of the joint, expected at least {expected_mm:.0} mm",
        ppa_core::text::number(*found_mm)
    )]
    TooShort {
        /// Length above the joint level.
        found_mm: f64,
        /// Length needed for two separate regions.
        expected_mm: f64,
    },
    /// A region has no limb in it, or the two are in the wrong order.
    #[error(
        "the {name} from {:.1} to {:.1} mm proximal of the joint {problem}",
        ppa_core::text::number(*from_mm), ppa_core::text::number(*to_mm)
    )]
    Region {
        /// "joint region" or "calf region".
        name: &'static str,
        /// Its beginning.
        from_mm: f64,
        /// Its end.
        to_mm: f64,
        /// What is wrong with it.
        problem: &'static str,
    },
    /// A direction or point given by the user cannot be used.
    #[error("{name} is {}, expected {expected}", ppa_core::text::numbers(*found))]
    Override {
        /// Field of [`LandmarkOverrides`].
        name: &'static str,
        /// Its value.
        found: [f64; 3],
        /// What it should be.
        expected: &'static str,
    },
    /// A joint centre given by the user is far from the limb.
    #[error(
        "joint_centre is {found:?}, {distance_mm:.0} mm outside the limb, expected at most {most_mm:.0} mm; the limb \
         reaches from {low:.0?} to {high:.0?} mm"
    )]
    JointFar {
        /// The point, `ct` frame, mm.
        found: [f64; 3],
        /// Distance to the nearest voxel of the limb, mm.
        distance_mm: f64,
        /// Largest distance that is accepted, mm.
        most_mm: f64,
        /// Low corner of the box around the limb, mm.
        low: [f64; 3],
        /// High corner of the box around the limb, mm.
        high: [f64; 3],
    },
    /// An anterior direction given by the user runs along the limb.
    #[error(
        "anterior is {found:?}, {angle_deg:.0} degrees from the limb's axis, expected at least {least_deg:.0}: it is the \
         direction that faces up at angle 0, across the limb"
    )]
    AnteriorAlongAxis {
        /// The direction.
        found: [f64; 3],
        /// Angle to the axis, whichever way it points, degrees.
        angle_deg: f64,
        /// Smallest angle that is accepted, degrees.
        least_deg: f64,
    },
    /// The axis is given by two points and by regions.
    #[error("axis and {other} are both given, expected only one of them")]
    AxisTwice {
        /// Field of [`LandmarkOverrides`].
        other: &'static str,
    },
    /// The axis source is "given", but no axis is given.
    #[error("axis_source is \"given\", but axis is missing: give its two points")]
    NoAxis,
    /// Two points given by the user do not form an axis along the limb.
    #[error("axis runs from {from:?} to {to:?}, expected {expected}")]
    Axis {
        /// The first point.
        from: [f64; 3],
        /// The second point.
        to: [f64; 3],
        /// What they should be.
        expected: &'static str,
    },
    /// Three points given by the user do not form a plane under the limb.
    #[error(
        "plane_points are ({}), ({}) and ({}), expected {expected}",
        ppa_core::text::numbers(found[0]), ppa_core::text::numbers(found[1]), ppa_core::text::numbers(found[2])
    )]
    Plane {
        /// The points.
        found: [[f64; 3]; 3],
        /// What they should be.
        expected: &'static str,
    },
    /// No plane touches both ends of the limb from below.
    #[error("no plane under the limb touches both its ends; give three plane points")]
    NoSupport,
    /// Most of the limb is behind the plane given by the user.
    #[error(
        "{behind_percent:.0} % of the limb lies behind the plane through the plane points, expected less than half"
    )]
    PlaneThroughLimb {
        /// Share of the surface behind the plane.
        behind_percent: f64,
    },
}

/// The value of `--limb` that selects a joint.
fn limb_of(joint: Joint) -> &'static str {
    match joint {
        Joint::Ankle => "lower-leg",
        Joint::Knee => "knee",
    }
}
