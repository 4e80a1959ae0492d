//! Tests of the crate from outside.

mod augmentation;
mod experiments;
mod loading;
mod toy;
mod training;
