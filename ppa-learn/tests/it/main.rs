//! Integration tests of the crate.

mod augmentation;
mod confidence;
mod experiments;
mod loading;
mod refusing;
mod resuming;
mod runs;
mod toy;
mod training;
