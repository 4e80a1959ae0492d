//! Identities of the third-party crates that affect the results of this one.

use std::any::TypeId;

/// The compiler's identities of the third-party crates of this crate, for the code key of datasets: each changes with the version,
/// features and profile of its crate and with the compiler, see `ppa-generate/src/compiled.rs`.
pub fn compiled_with() -> Vec<TypeId> {
    vec![TypeId::of::<image::ColorType>()]
}
