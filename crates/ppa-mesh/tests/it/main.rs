//! Tests through the public interface.

mod fields;
mod reference;
mod surface;
