//! A tensor that was made already, as what an operation gives.

use candle_core::backend::BackendStorage;
use candle_core::{CpuStorage, CudaStorage, Error, Result, Shape, Storage, Tensor};

pub fn cpu(made: &Tensor) -> Result<(CpuStorage, Shape)> {
    let (storage, layout) = made.storage_and_layout();
    match &*storage {
        Storage::Cpu(values) => Ok((values.try_clone(layout)?, layout.shape().clone())),
        _ => Err(elsewhere()),
    }
}

pub fn cuda(made: &Tensor) -> Result<(CudaStorage, Shape)> {
    let (storage, layout) = made.storage_and_layout();
    match &*storage {
        Storage::Cuda(values) => Ok((values.try_clone(layout)?, layout.shape().clone())),
        _ => Err(elsewhere()),
    }
}

fn elsewhere() -> Error {
    Error::msg("inputs and outputs of an operation lie on different devices").bt()
}
