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

mod frames;
mod landmarks;
mod placement;
mod room;

pub use ppa_core::{RigidError, Side};

pub use frames::{Camera, Ct, Device, Patient, Rigid, Room};
pub use landmarks::bump_sites::bump_sites;
pub use landmarks::choices::{LandmarkError, LandmarkOverrides};
pub use landmarks::find::find_landmarks;
pub use landmarks::found::{AxisRegion, AxisSource, FoundJoint, KneeLines, Landmarks};
pub use landmarks::knee_axis::KneeAxis;
pub use landmarks::limb_kind::{Joint, LimbKind};
pub use landmarks::measures::{Fibula, LimbMeasures, LimbSize, Neighbour, Shaft, Support};
pub use landmarks::notes::LandmarkNote;
pub use placement::error::PlaceError;
pub use placement::place::{
    Contact, PlaceSettings, Placement, ct_from_device, medial_rotation, place, place_with,
};
pub use placement::positioning::Positioning;
pub use placement::soft_tissue::{Flattening, SoftTissue};
pub use placement::sweep::{PoseAngle, Sweep, SweepError};
pub use room::device::XrayDevice;
pub use room::error::RoomError;
pub use room::plane::Plane;
pub use room::plane_settings::{PlaneError, PlaneSettings};
pub use room::spec::RoomSpec;
pub use room::table_plane::{TablePlane, table_plane};
pub use room::xray_room::XrayRoom;
