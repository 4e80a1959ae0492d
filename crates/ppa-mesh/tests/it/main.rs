//! Tests through the public interface.

mod clusters;
mod fields;
mod limb;
mod ply;
mod reference;
mod surface;
