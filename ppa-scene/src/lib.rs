//! Scene of a synthetic radiograph: a limb from a CT scan, laid on the table under the x-ray beam.
//!
//! [`find_landmarks`] finds how a limb lies in its scan, [`XrayRoom`] is the x-ray room with its
//! device, [`table_plane`] finds the table in the room's cloud, and [`place`] rotates the limb
//! and lays it down. [`ct_from_device`] takes the device back into the scan, where the
//! radiograph is computed without rotating a voxel.
//!
//! Units: mm, radians (degrees where a name ends in `_deg`). Frames are types ([`Ct`],
//! [`Patient`], [`Room`], [`Device`], [`Camera`]); a [`Rigid`] is named `target_from_source`.
//! Source of the method: Laufer et al., MELBA 2026:027, section "Framework", doi:10.59275/j.melba.2026-c874.

mod ankle;
mod axis_regions;
mod bone_spans;
mod bump_sites;
mod condyles;
mod contact;
mod device;
mod find_landmarks;
mod frames;
mod given_choices;
mod hull;
mod joints;
mod knee;
mod knee_axis;
mod knee_gap;
mod knee_regions;
mod landmark_choices;
mod landmark_notes;
mod landmarks;
mod limb_kind;
mod limb_sections;
mod matching;
mod measures;
mod outlines;
mod patch;
mod place_error;
mod placement;
mod plane;
mod plane_settings;
mod reslice;
mod room;
mod room_error;
mod room_parts;
mod room_spec;
mod soft_tissue;
mod supporting_plane;
mod sweep;
mod table_plane;

pub use ppa_core::{RigidError, Side};

pub use bump_sites::bump_sites;
pub use device::XrayDevice;
pub use find_landmarks::find_landmarks;
pub use frames::{Camera, Ct, Device, Patient, Rigid, Room};
pub use knee_axis::KneeAxis;
pub use landmark_choices::{LandmarkError, LandmarkOverrides};
pub use landmark_notes::LandmarkNote;
pub use landmarks::{AxisRegion, AxisSource, FoundJoint, KneeLines, Landmarks};
pub use limb_kind::{Joint, LimbKind};
pub use measures::{Fibula, LimbMeasures, LimbSize, Neighbour, Shaft, Support};
pub use place_error::PlaceError;
pub use placement::{Contact, Placement, ct_from_device, medial_rotation, place, place_soft};
pub use plane::Plane;
pub use plane_settings::{PlaneError, PlaneSettings};
pub use room::XrayRoom;
pub use room_error::RoomError;
pub use room_spec::RoomSpec;
pub use soft_tissue::{Flattening, SoftTissue};
pub use sweep::{PoseAngle, Sweep, SweepError};
pub use table_plane::{TablePlane, table_plane};
