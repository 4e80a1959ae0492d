//! Depthwise convolution, with its gradients.

use candle_core::{Error, Result, Tensor};

use super::super::tape::Size;
use super::reduce;
use crate::device::launch::Launch;
use crate::kernels::depthwise::Window;

/// `COLUMNS` of `kernels.cu`.
const COLUMNS: usize = 4;

/// Computes [images, rows, columns, channels] from x [images, height, width, channels] and weights [channels, kernel * kernel].
///
/// If x has one channel, every output channel reads it.
pub fn depthwise(x: &Tensor, weights: &Tensor, window: Window) -> Result<Tensor> {
    check(window)?;
    let (images, height, width, inputs) = x.dims4()?;
    let channels = weights.dim(0)?;
    let size = Size {
        images,
        height,
        width,
    };
    let out = size.after(window);
    let sizes = [
        height,
        width,
        inputs,
        out.height,
        out.width,
        channels,
        window.kernel,
        window.stride,
    ];
    let threads = images * out.height * groups(out.width) * channels;
    let out = (images, out.height, out.width, channels);
    Launch::new("depthwise", out, threads, &sizes).run(&[x, &by_tap(weights)?])
}

/// Computes the gradient of x, with the shape of `of`, from that of the output.
pub fn of_input(
    gradient: &Tensor,
    weights: &Tensor,
    window: Window,
    of: &Tensor,
) -> Result<Tensor> {
    let (images, height, width, channels) = of.dims4()?;
    let (_, rows, columns, _) = gradient.dims4()?;
    let sizes = [
        height,
        width,
        rows,
        columns,
        channels,
        window.kernel,
        window.stride,
    ];
    let threads = images * height * groups(width) * channels;
    let launch = Launch::new("depthwise_of_input", of.shape(), threads, &sizes);
    launch.run(&[gradient, &by_tap(weights)?])
}

/// Computes the gradient of the weights [channels, kernel * kernel].
pub fn of_weights(x: &Tensor, gradient: &Tensor, window: Window) -> Result<Tensor> {
    let (images, height, width, inputs) = x.dims4()?;
    let (_, rows, columns, channels) = gradient.dims4()?;
    let Window { kernel, stride } = window;
    let lines = images * rows;
    let parts = reduce::parts(channels, lines * columns).min(lines);
    let sizes = [
        lines, height, width, inputs, rows, columns, channels, kernel, stride, parts,
    ];
    let launch = Launch::new(
        "depthwise_of_weights",
        (parts, kernel * kernel, channels),
        parts * channels,
        &sizes,
    );
    let by_tap = reduce::sum(launch.run(&[x, gradient])?)?;
    by_tap.t()?.contiguous()
}

/// Refuses windows without a kernel.
fn check(Window { kernel, stride }: Window) -> Result<()> {
    match (kernel, stride) {
        (3 | 5, 1 | 2) => Ok(()),
        _ => Err(Error::msg(format!(
            "there is no kernel for windows of {kernel}, stride {stride}"
        ))
        .bt()),
    }
}

/// Returns the number of groups of neighbouring columns, each written by one thread.
fn groups(columns: usize) -> usize {
    columns.div_ceil(COLUMNS)
}

/// Returns weights [kernel * kernel, channels], so that neighbouring threads read neighbouring addresses.
fn by_tap(weights: &Tensor) -> Result<Tensor> {
    weights.t()?.contiguous()
}
