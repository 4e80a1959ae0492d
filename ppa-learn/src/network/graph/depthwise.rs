//! Convolution of each channel by its own window, with its gradients.

use candle_core::{CpuStorage, CudaStorage, CustomOp2, Layout, Result, Shape, Tensor};

use super::super::tape::Size;
use super::launch::Launch;
use crate::kernels::depthwise::Window;

/// Threads that keep a device busy.
pub const THREADS: usize = 65_536;

/// [images, rows, columns, channels] of x [images, height, width, channels] and weights [channels, kernel * kernel].
///
/// An x of one channel is taken for every channel; it has no gradient.
pub fn depthwise(x: &Tensor, weights: &Tensor, window: Window) -> Result<Tensor> {
    let (images, height, width, inputs) = x.dims4()?;
    let size = Size {
        images,
        height,
        width,
    };
    let operation = Depthwise {
        size,
        out: size.after(window),
        inputs,
        channels: weights.dim(0)?,
        window,
    };
    x.contiguous()?.apply_op2(&weights.contiguous()?, operation)
}

/// From (x, weights) to the output.
struct Depthwise {
    size: Size,
    out: Size,
    inputs: usize,
    channels: usize,
    window: Window,
}

impl Depthwise {
    fn shape(&self, size: Size) -> Shape {
        (size.images, size.height, size.width, self.channels).into()
    }

    fn forward(&self) -> Launch {
        let out = self.shape(self.out);
        Launch {
            kernel: "depthwise",
            threads: out.elem_count(),
            sizes: vec![
                self.size.height,
                self.size.width,
                self.inputs,
                self.out.height,
                self.out.width,
                self.channels,
                self.window.kernel,
                self.window.stride,
            ],
            out,
        }
    }

    /// Of (gradient of the output, weights).
    fn of_input(&self) -> Launch {
        let out = self.shape(self.size);
        Launch {
            kernel: "depthwise_of_input",
            threads: out.elem_count(),
            sizes: vec![
                self.size.height,
                self.size.width,
                self.out.height,
                self.out.width,
                self.channels,
                self.window.kernel,
                self.window.stride,
            ],
            out,
        }
    }

    /// Parts of the sum [parts, kernel * kernel, channels], of (x, gradient of the output).
    fn of_weights(&self) -> Launch {
        let all_rows = self.size.images * self.out.height;
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
