//! Cross-crate benches live in the `benches` folder beside this file; there is nothing to link against.
