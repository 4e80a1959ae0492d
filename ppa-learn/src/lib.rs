#![doc = include_str!("../README.md")]

mod device;
mod kernels;
mod network;
mod parity;
mod random;
mod weights;

pub mod confidence;
pub mod data;
pub mod evaluate;
pub mod experiment;
pub mod frames;
pub mod train;

pub use device::{DeviceError, DeviceName};
pub use network::{
    CORRECTION_UNIT_DEG, EfficientNetB0, Entry, Fusion, FusionKind, InferenceNetwork, Mode, Named,
    NetworkError, Options, Place, PosePrediction, QualityNetwork, Targets,
};
pub use parity::{Parity, parity};
pub use random::{Purpose, stream};
pub use weights::{FirstConvolution, Loaded, WeightsError, WeightsMetadata};
