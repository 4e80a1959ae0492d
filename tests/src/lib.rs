//! Cross-crate tests live in the `tests` folder beside this file; there is nothing to link against.
