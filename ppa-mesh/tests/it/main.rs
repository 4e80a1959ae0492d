//! Tests through the public interface.

mod body_shape;
mod clusters;
mod cut_off;
mod fields;
mod kept_bodies;
mod limb;
mod limb_real;
mod mesh_file;
mod reference;
mod surface;
mod walls;
