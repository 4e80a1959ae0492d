//! Tests through the public interface.

mod clusters;
mod fields;
mod limb;
mod limb_real;
mod ply;
mod reference;
mod surface;
