//! Launches of the kernels in `kernels.cu`.

#[cfg(feature = "cuda")]
mod cuda;
#[cfg(test)]
mod emulated;
#[cfg(not(all(feature = "cuda", test)))]
mod nowhere;

use std::ops::Range;

use candle_core::op::BackpropOp;
use candle_core::{Error, Layout, Result, Shape, Storage, Tensor};

#[cfg(feature = "cuda")]
pub use cuda::open;
#[cfg(feature = "cuda")]
use cuda::run as on_cuda;
#[cfg(test)]
use emulated::run as on_cpu;
#[cfg(not(test))]
use nowhere::run as on_cpu;
#[cfg(not(feature = "cuda"))]
use nowhere::run as on_cuda;

/// Source code of the kernels.
#[cfg(any(feature = "cuda", test))]
const KERNELS: &str = include_str!("kernels.cu");

/// Maximum number of values of a tensor: indices are signed 32-bit integers and may pass the end by a step before they are compared.
const MOST_VALUES: usize = 1 << 30;

/// Launch of a kernel with the parameters (out, inputs, threads, sizes, floats).
#[derive(Debug)]
pub struct Launch {
    kernel: &'static str,
    threads: usize,
    sizes: Vec<usize>,
    floats: Vec<f32>,
    out: Shape,
}

/// Checked arguments of a kernel.
#[cfg_attr(
    not(any(feature = "cuda", test)),
    expect(dead_code, reason = "what runs nowhere reads nothing")
)]
struct Given<'a, S> {
    /// Storage and range of the values of each input.
    inputs: Vec<(&'a S, Range<usize>)>,
    /// Threads and sizes.
    integers: Vec<i32>,
    floats: &'a [f32],
}

impl Launch {
    /// Launch of a kernel with `threads` threads and its `sizes`, in the order of its parameters; it writes a tensor of shape `out`.
    pub fn new(
        kernel: &'static str,
        out: impl Into<Shape>,
        threads: usize,
        sizes: &[usize],
    ) -> Self {
        Self {
            kernel,
            threads,
            sizes: sizes.to_vec(),
            floats: Vec::new(),
            out: out.into(),
        }
    }

    /// Launch with one thread per output value.
    pub fn of_values(kernel: &'static str, out: impl Into<Shape>, sizes: &[usize]) -> Self {
        let out = out.into();
        let threads = out.elem_count();
        Self::new(kernel, out, threads, sizes)
    }

    /// The same launch with floats after its sizes.
    pub fn with(self, floats: &[f32]) -> Self {
        Self {
            floats: floats.to_vec(),
            ..self
        }
    }

    /// Runs the kernel on contiguous inputs, all on one device, and returns its output, which has no gradient.
    pub fn run(&self, inputs: &[&Tensor]) -> Result<Tensor> {
        let device = inputs[0].device();
        if inputs
            .iter()
            .any(|input| !input.device().same_device(device))
        {
            return Err(elsewhere());
        }
        let given: Vec<_> = inputs.iter().map(|x| x.storage_and_layout()).collect();
        let (mut cpu, mut cuda) = (Vec::new(), Vec::new());
        for (storage, layout) in &given {
            match &**storage {
                Storage::Cpu(storage) => cpu.push((storage, *layout)),
                Storage::Cuda(storage) => cuda.push((storage, *layout)),
                Storage::Metal(_) => {}
            }
        }
        let storage = if cuda.len() == inputs.len() {
            Storage::Cuda(on_cuda(self, &self.given(&cuda)?)?)
        } else if cpu.len() == inputs.len() {
            // Only in tests: the network has its own kernels for the CPU.
            Storage::Cpu(on_cpu(self, &self.given(&cpu)?)?)
        } else {
            return Err(elsewhere());
        };
        let untracked = BackpropOp::none();
        Ok(Tensor::from_storage(
            storage,
            self.out.clone(),
            untracked,
            false,
        ))
    }

    /// Returns the kernel's arguments, if it can address all values.
    fn given<'a, S>(&'a self, inputs: &[(&'a S, &Layout)]) -> Result<Given<'a, S>> {
        let lengths = inputs.iter().map(|(_, layout)| layout.shape().elem_count());
        let mut lengths = lengths.chain([self.out.elem_count(), self.threads]);
        if let Some(length) = lengths.find(|&length| MOST_VALUES < length) {
            let Self { kernel, .. } = self;
            let error = format!("{kernel} takes at most {MOST_VALUES} values, found {length}");
            return Err(Error::msg(error).bt());
        }
        let place = |(storage, layout): &(&'a S, &Layout)| {
            Ok((*storage, contiguous_range(layout, self.kernel)?))
        };
        let integers = [self.threads].into_iter().chain(self.sizes.clone());
        Ok(Given {
            inputs: inputs.iter().map(place).collect::<Result<_>>()?,
            integers: integers.map(|integer| integer as i32).collect(),
            floats: &self.floats,
        })
    }
}

/// Returns the range of the values of a contiguous tensor in its storage.
pub fn contiguous_range(layout: &Layout, op: &'static str) -> Result<Range<usize>> {
    let offsets = layout.contiguous_offsets();
    let (start, end) = offsets.ok_or_else(|| Error::RequiresContiguous { op }.bt())?;
    Ok(start..end)
}

/// Error for inputs and outputs on different devices.
pub fn elsewhere() -> Error {
    Error::msg("inputs and outputs of an operation are on different devices").bt()
}

#[cfg(test)]
mod tests {
    use candle_core::CpuStorage;

    use super::*;

    #[test]
    fn what_kernels_cannot_address_is_refused() {
        let of = |images: usize| Launch::new("depthwise", (images, 168, 168, 96), 1, &[336, 336]);
        let fits = of(396);
        let given = fits.given::<CpuStorage>(&[]).unwrap();
        assert_eq!(given.integers, [1, 336, 336]);
        let error = of(397).given::<CpuStorage>(&[]).err().unwrap().to_string();
        let expected = "at most 1073741824 values, found 1075673088";
        assert!(error.contains(expected), "{error}");
    }
}
