//! A limb rotated and laid on the table, and the sweep of its poses.

pub(crate) mod error;
pub(crate) mod matching;
pub(crate) mod place;
pub(crate) mod positioning;
pub(crate) mod soft_tissue;
pub(crate) mod sweep;
