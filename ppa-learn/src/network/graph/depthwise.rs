//! Convolution of each channel by its own window, with its gradients.

use candle_core::{CpuStorage, CudaStorage, CustomOp2, Layout, Result, Shape, Tensor};

use super::launch::Launch;
use crate::kernels::depthwise::Window;

/// Threads that keep a device busy.
pub const THREADS: usize = 65_536;

/// [images, rows, columns, channels] of x [images, height, width, channels] and weights [channels, kernel * kernel].
///
/// An x of one channel is taken for every channel; it has no gradient.
pub fn depthwise(x: &Tensor, weights: &Tensor, window: Window) -> Result<Tensor> {
    let (images, height, width, inputs) = x.dims4()?;
    let operation = Depthwise {
        images,
        height,
        width,
        inputs,
        channels: weights.dim(0)?,
        window,
    };
    x.contiguous()?.apply_op2(&weights.contiguous()?, operation)
}

/// From (x, weights) to the output.
struct Depthwise {
    images: usize,
    height: usize,
    width: usize,
    inputs: usize,
    channels: usize,
    window: Window,
}

impl Depthwise {
    fn rows(&self) -> usize {
        self.window.output(self.height)
    }

    fn columns(&self) -> usize {
        self.window.output(self.width)
    }

    fn forward(&self) -> Launch {
        let out = Shape::from((self.images, self.rows(), self.columns(), self.channels));
        Launch {
            kernel: "depthwise",
            threads: out.elem_count(),
            sizes: vec![
                self.height,
                self.width,
                self.inputs,
                self.rows(),
                self.columns(),
                self.channels,
                self.window.kernel,
                self.window.stride,
            ],
            out,
        }
    }

    /// Of (gradient of the output, weights).
    fn of_input(&self) -> Launch {
        let out = Shape::from((self.images, self.height, self.width, self.channels));
        Launch {
            kernel: "depthwise_of_input",
            threads: out.elem_count(),
            sizes: vec![
                self.height,
                self.width,
                self.rows(),
                self.columns(),
                self.channels,
                self.window.kernel,
                self.window.stride,
            ],
            out,
        }
    }

    /// Parts of the sum [parts, kernel * kernel, channels], of (x, gradient of the output).
    fn of_weights(&self) -> Launch {
        let all_rows = self.images * self.rows();
        let taps = self.window.kernel * self.window.kernel;
        let parts = (THREADS / (taps * self.channels)).clamp(1, all_rows);
        let out = Shape::from((parts, taps, self.channels));
        let mut sizes = self.forward().sizes;
        sizes.extend([all_rows, parts]);
        Launch {
            kernel: "depthwise_of_weights",
            threads: out.elem_count(),
            sizes,
            out,
        }
    }
}

impl CustomOp2 for Depthwise {
    fn name(&self) -> &'static str {
        "depthwise"
    }

    fn cpu_fwd(
        &self,
        x: &CpuStorage,
        x_layout: &Layout,
        weights: &CpuStorage,
        layout: &Layout,
    ) -> Result<(CpuStorage, Shape)> {
        self.forward().cpu(&[(x, x_layout), (weights, layout)])
    }

    fn cuda_fwd(
        &self,
        x: &CudaStorage,
        x_layout: &Layout,
        weights: &CudaStorage,
        layout: &Layout,
    ) -> Result<(CudaStorage, Shape)> {
        self.forward().cuda(&[(x, x_layout), (weights, layout)])
    }

    fn bwd(
        &self,
        x: &Tensor,
        weights: &Tensor,
        _: &Tensor,
        gradient: &Tensor,
    ) -> Result<(Option<Tensor>, Option<Tensor>)> {
        let gradient = gradient.contiguous()?;
        let of_input = match self.inputs == self.channels {
            true => Some(self.of_input().run(&[&gradient, weights])?),
            false => None,
        };
        let of_weights = self.of_weights().run(&[x, &gradient])?.sum(0)?;
        Ok((of_input, Some(of_weights.t()?.contiguous()?)))
    }
}
