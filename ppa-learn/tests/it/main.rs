//! Tests of the crate from outside.

mod augmentation;
mod confidence;
mod experiments;
mod loading;
mod refusing;
mod resuming;
mod runs;
mod toy;
mod training;
