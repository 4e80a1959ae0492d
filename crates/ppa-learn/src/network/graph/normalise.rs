//! Batch normalisation and the activation behind it, with their gradients.

use candle_core::{
    CpuStorage, CudaStorage, CustomOp1, CustomOp2, D, Layout, Result, Shape, Tensor,
};

use super::depthwise::THREADS;
use super::launch::Launch;
use super::made;

/// Mean and biased variance [2, channels] of each channel of x [.., channels].
pub fn moments(x: &Tensor) -> Result<Tensor> {
    let x = x.contiguous()?;
    let channels = x.dim(D::Minus1)?;
    let pixels = x.elem_count() / channels;
    let about = |center: &Tensor| {
        let launch = of_parts("moments", pixels, channels);
        launch.run(&[&x, center])?.sum(0)? / pixels as f64
    };
    // About the mean itself, as sums of large squares lose digits in f32.
    let zero = Tensor::zeros(channels, x.dtype(), x.device())?;
    let mean = about(&zero)?.get(0)?;
    let about_mean = about(&mean)?;
    let rest = about_mean.get(0)?;
    let variance = (about_mean.get(1)? - rest.sqr()?)?;
    let found = Tensor::stack(&[(mean + rest)?, variance], 0)?;
    x.apply_op1(Moments { pixels, found })
}

/// SiLU(z), or z itself, where z = scale (x - mean) + bias for each channel of x [.., channels]; `norm` [3, channels] holds
/// mean, scale and bias.
pub fn normalise(x: &Tensor, norm: &Tensor, activated: bool) -> Result<Tensor> {
    let shape = x.shape().clone();
    let operation = Normalise { shape, activated };
    x.contiguous()?.apply_op2(&norm.contiguous()?, operation)
}

/// A kernel that sums over pixels to [parts, 2, channels].
fn of_parts(kernel: &'static str, pixels: usize, channels: usize) -> Launch {
    let parts = (THREADS / channels).clamp(1, pixels);
    Launch {
        kernel,
        threads: parts * channels,
        sizes: vec![pixels, channels, parts],
        out: (parts, 2, channels).into(),
    }
}

/// A kernel that makes a value of each value.
fn of_values(kernel: &'static str, shape: &Shape) -> Launch {
    Launch {
        kernel,
        threads: shape.elem_count(),
        sizes: shape.dims().last().copied().into_iter().collect(),
        out: shape.clone(),
    }
}

/// From x to its moments, which were found.
struct Moments {
    pixels: usize,
    found: Tensor,
}

impl CustomOp1 for Moments {
    fn name(&self) -> &'static str {
        "moments"
    }

    fn cpu_fwd(&self, _: &CpuStorage, _: &Layout) -> Result<(CpuStorage, Shape)> {
        made::cpu(&self.found)
    }

    fn cuda_fwd(&self, _: &CudaStorage, _: &Layout) -> Result<(CudaStorage, Shape)> {
        made::cuda(&self.found)
    }

    /// 2 (x - mean) / pixels of the variance's gradient, and 1 / pixels of the mean's.
    fn bwd(&self, x: &Tensor, found: &Tensor, gradient: &Tensor) -> Result<Option<Tensor>> {
        let each = (gradient / self.pixels as f64)?;
        let linear = Tensor::stack(&[found.get(0)?, (each.get(1)? * 2.0)?, each.get(0)?], 0)?;
        let of_x = of_values("normalise", x.shape()).run(&[x, &linear.detach()])?;
        Ok(Some(of_x))
    }
}

/// From (x, norm) to z or SiLU(z).
struct Normalise {
    shape: Shape,
    activated: bool,
}

impl Normalise {
    fn forward(&self) -> Launch {
        let kernel = if self.activated {
            "activate"
        } else {
            "normalise"
        };
        of_values(kernel, &self.shape)
    }
}

impl CustomOp2 for Normalise {
    fn name(&self) -> &'static str {
        "normalise"
    }

    fn cpu_fwd(
        &self,
        x: &CpuStorage,
        x_layout: &Layout,
        norm: &CpuStorage,
        layout: &Layout,
    ) -> Result<(CpuStorage, Shape)> {
        self.forward().cpu(&[(x, x_layout), (norm, layout)])
    }

    fn cuda_fwd(
        &self,
        x: &CudaStorage,
        x_layout: &Layout,
        norm: &CudaStorage,
        layout: &Layout,
    ) -> Result<(CudaStorage, Shape)> {
        self.forward().cuda(&[(x, x_layout), (norm, layout)])
    }

    fn bwd(
        &self,
        x: &Tensor,
        norm: &Tensor,
        _: &Tensor,
        gradient: &Tensor,
    ) -> Result<(Option<Tensor>, Option<Tensor>)> {
        let gradient = gradient.contiguous()?;
        let of_z = match self.activated {
            true => of_values("activate_of_normed", &self.shape).run(&[x, &gradient, norm])?,
            false => gradient,
        };
        let channels = norm.dim(1)?;
        let sums = of_parts("normalise_of_norm", x.elem_count() / channels, channels);
        let sums = sums.run(&[x, &of_z, norm])?.sum(0)?;
        let (of_bias, of_scale) = (sums.get(0)?, sums.get(1)?);
        let scale = norm.get(1)?.detach();
        let of_mean = (&of_bias * &scale)?.neg()?;
        let of_norm = Tensor::stack(&[of_mean, of_scale, of_bias], 0)?;
        Ok((Some(of_z.broadcast_mul(&scale)?), Some(of_norm)))
    }
}
