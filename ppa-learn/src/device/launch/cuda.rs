//! Kernels on NVIDIA devices, compiled when the first one runs.
#![allow(unsafe_code)]

use std::sync::OnceLock;

use candle_core::backend::BackendStorage;
use candle_core::cuda_backend::WrapErr;
use candle_core::cuda_backend::cudarc::driver::{LaunchConfig, PushKernelArg};
use candle_core::cuda_backend::cudarc::nvrtc::compile_ptx;
use candle_core::{CudaStorage, Device, Error, Result};

use super::{Given, KERNELS, Launch};

/// Number of threads per block.
const BLOCK: u32 = 256;

/// Opens a device with one stream for all threads, because the networks of two cameras run on two threads: with `Device::new_cuda` each
/// thread would have its own stream, and none would wait for the results of another.
pub fn open(number: usize) -> Result<Device> {
    let device = Device::new_cuda_with_stream(number)?;
    // SAFETY: events order the work of several streams, and this device has one. Recording them costs as much as a launch.
    unsafe { device.as_cuda_device()?.disable_event_tracking() };
    Ok(device)
}

pub fn run(launch: &Launch, given: &Given<CudaStorage>) -> Result<CudaStorage> {
    let device = given.inputs[0].0.device().clone();
    let mut views = Vec::new();
    for (storage, place) in &given.inputs {
        views.push(storage.as_cuda_slice::<f32>()?.slice(place.clone()));
    }
    let function = device.get_or_load_custom_func(launch.kernel, "ppa-learn", ptx()?)?;
    // SAFETY: every kernel writes each value of `out` before anything reads it.
    let mut out = unsafe { device.alloc::<f32>(launch.out.elem_count()) }?;
    let mut builder = function.builder();
    builder.arg(&mut out);
    for view in &views {
        builder.arg(view);
    }
    for integer in &given.integers {
        builder.arg(integer);
    }
    for float in given.floats {
        builder.arg(float);
    }
    let config = LaunchConfig {
        grid_dim: ((launch.threads as u32).div_ceil(BLOCK), 1, 1),
        block_dim: (BLOCK, 1, 1),
        shared_mem_bytes: 0,
    };
    // SAFETY: the arguments are in the order of the kernel's own, and all inputs are of f32 on this device. The functions that
    // build launches derive sizes from the shapes of their tensors, so that a kernel stays within them; tests of all kernels on
    // odd shapes check every access on the CPU, with AddressSanitizer where the compiler has it (`emulated.rs`).
    unsafe { builder.launch(config) }.w()?;
    Ok(CudaStorage::wrap_cuda_slice(out, device))
}

/// Returns the compiled kernels.
fn ptx() -> Result<&'static str> {
    static PTX: OnceLock<std::result::Result<String, String>> = OnceLock::new();
    let compile = || match compile_ptx(KERNELS) {
        Ok(ptx) => Ok(ptx.to_src()),
        Err(error) => Err(format!("the kernels do not compile: {error}")),
    };
    let compiled = PTX.get_or_init(compile).as_deref();
    compiled.map_err(|error| Error::msg(error).bt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kernel_compiles() {
        let ptx = ptx().unwrap();
        let names = KERNELS.lines().filter_map(|line| {
            let declared = line.strip_prefix("KERNEL ")?;
            declared.split_once('(').map(|(name, _)| name)
        });
        let names: Vec<&str> = names.collect();
        assert_eq!(names.len(), 17);
        for name in names {
            assert!(ptx.contains(&format!(".visible .entry {name}(")), "{name}");
        }
    }
}
