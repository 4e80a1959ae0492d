//! Tests of the crate from outside.

mod augmentation;
mod loading;
mod toy;
mod training;
