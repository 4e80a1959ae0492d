#![doc = include_str!("../README.md")]

mod random;

pub mod data;

pub use random::{Purpose, stream};
