//! The iso-surface against answers that can be derived.
