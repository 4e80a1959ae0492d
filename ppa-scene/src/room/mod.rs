//! The x-ray room: device, cameras, recorded cloud, plane of the table.

pub(crate) mod device;
pub(crate) mod error;
pub(crate) mod parts;
pub(crate) mod patch;
pub(crate) mod plane;
pub(crate) mod plane_settings;
pub(crate) mod spec;
pub(crate) mod table_plane;
pub(crate) mod xray_room;
