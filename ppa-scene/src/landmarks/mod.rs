//! Landmarks of a limb in its scan: kind, side, joint, axis of rotation, plane.

pub(crate) mod ankle;
pub(crate) mod axis_regions;
pub(crate) mod bone_spans;
pub(crate) mod bump_sites;
pub(crate) mod choices;
pub(crate) mod condyles;
pub(crate) mod contact;
pub(crate) mod find;
pub(crate) mod found;
pub(crate) mod given_choices;
pub(crate) mod hull;
pub(crate) mod joints;
pub(crate) mod knee;
pub(crate) mod knee_axis;
pub(crate) mod knee_gap;
pub(crate) mod knee_regions;
pub(crate) mod limb_kind;
pub(crate) mod limb_sections;
pub(crate) mod measures;
pub(crate) mod notes;
pub(crate) mod outlines;
pub(crate) mod reslice;
pub(crate) mod supporting_plane;
