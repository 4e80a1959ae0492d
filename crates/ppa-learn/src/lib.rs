#![doc = include_str!("../README.md")]

mod kernels;
mod network;
mod random;
mod weights;

pub mod data;
pub mod experiment;

pub use network::{EfficientNetB0, Entry, Mode, Named, NetworkError, Options};
pub use random::{Purpose, stream};
pub use weights::WeightsError;
