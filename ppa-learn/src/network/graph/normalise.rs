//! Batch normalisation and the activation behind it, with their gradients.

use candle_core::{CpuStorage, CudaStorage, CustomOp2, D, Layout, Result, Shape, Storage, Tensor};

use super::super::norm::EPSILON;
use super::depthwise::THREADS;
use super::launch::{Launch, elsewhere};

/// Mean and biased variance of each channel, both [channels].
pub struct Moments {
    pub mean: Tensor,
    pub variance: Tensor,
}

impl Moments {
    /// Of x [.., channels].
    pub fn of(x: &Tensor) -> Result<Self> {
        let x = x.detach().contiguous()?;
        let channels = x.dim(D::Minus1)?;
        let pixels = x.elem_count() / channels;
        let about = |center: &Tensor| {
            let launch = of_parts("moments", pixels, channels);
            launch.run(&[&x, center])?.sum(0)? / pixels as f64
        };
        // About the mean itself, as sums of large squares lose digits in f32.
        let zero = Tensor::zeros(channels, x.dtype(), x.device())?;
        let mean = about(&zero)?.get(0)?.contiguous()?;
        let about_mean = about(&mean)?;
        let rest = about_mean.get(0)?;
        let variance = (about_mean.get(1)? - rest.sqr()?)?;
        Ok(Self {
            mean: (mean + rest)?,
            variance,
        })
    }
}

/// A normalisation of x [.., channels] by moments [channels] that do not depend on it: SiLU(z), or z itself where it is not
/// `activated`, with z = weight (x - mean) / sigma + bias for `affine` [weight and bias, channels].
pub fn by_constants(
    x: &Tensor,
    affine: &Tensor,
    moments: &Moments,
    activated: bool,
) -> Result<Tensor> {
    let norm = Norm::new(affine, moments)?;
    let launch = of_values(forward(activated), x.shape());
    launch.run(&[&x.contiguous()?, &norm.coefficients])
}

/// The same by the moments of x, with gradients of x and of `affine`.
pub fn by_batch(x: &Tensor, affine: &Tensor, moments: &Moments, activated: bool) -> Result<Tensor> {
    let operation = Normalise {
        shape: x.shape().clone(),
        norm: Norm::new(affine, moments)?,
        activated,
    };
    x.contiguous()?.apply_op2(affine, operation)
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

/// The kernel of z, or of SiLU(z).
fn forward(activated: bool) -> &'static str {
    if activated { "activate" } else { "normalise" }
}

/// What a normalisation multiplies by and adds.
struct Norm {
    mean: Tensor,
    /// 1 / sigma
    inverse: Tensor,
    /// weight / sigma
    scale: Tensor,
    /// [mean, scale and bias, channels]
    coefficients: Tensor,
}

impl Norm {
    fn new(affine: &Tensor, moments: &Moments) -> Result<Self> {
        let Moments { mean, variance } = moments;
        let affine = affine.detach();
        let inverse = (variance + EPSILON)?.sqrt()?.recip()?;
        let scale = (affine.get(0)? * &inverse)?;
        let coefficients = Tensor::stack(&[mean, &scale, &affine.get(1)?], 0)?;
        Ok(Self {
            mean: mean.clone(),
            inverse,
            scale,
            coefficients,
        })
    }
}

/// From (x, affine) to z or SiLU(z).
struct Normalise {
    shape: Shape,
    norm: Norm,
    activated: bool,
}

impl CustomOp2 for Normalise {
    fn name(&self) -> &'static str {
        "normalise"
    }

    fn cpu_fwd(
        &self,
        x: &CpuStorage,
        x_layout: &Layout,
        _: &CpuStorage,
        _: &Layout,
    ) -> Result<(CpuStorage, Shape)> {
        let (norm, layout) = self.norm.coefficients.storage_and_layout();
        let Storage::Cpu(norm) = &*norm else {
            return Err(elsewhere());
        };
        of_values(forward(self.activated), &self.shape).cpu(&[(x, x_layout), (norm, layout)])
    }

    fn cuda_fwd(
        &self,
        x: &CudaStorage,
        x_layout: &Layout,
        _: &CudaStorage,
        _: &Layout,
    ) -> Result<(CudaStorage, Shape)> {
        let (norm, layout) = self.norm.coefficients.storage_and_layout();
        let Storage::Cuda(norm) = &*norm else {
            return Err(elsewhere());
        };
        of_values(forward(self.activated), &self.shape).cuda(&[(x, x_layout), (norm, layout)])
    }

    /// Ioffe and Szegedy 2015 (arXiv:1502.03167), section 3, with the sums over a channel taken first.
    fn bwd(
        &self,
        x: &Tensor,
        _: &Tensor,
        _: &Tensor,
        gradient: &Tensor,
    ) -> Result<(Option<Tensor>, Option<Tensor>)> {
        let Norm {
            mean,
            inverse,
            scale,
            coefficients,
        } = &self.norm;
        let gradient = gradient.contiguous()?;
        let of_z = match self.activated {
            true => {
                let launch = of_values("activate_of_normed", &self.shape);
                launch.run(&[x, &gradient, coefficients])?
            }
            false => gradient,
        };
        let channels = mean.dim(0)?;
        let pixels = self.shape.elem_count() / channels;
        let sums = of_parts("normalise_of_affine", pixels, channels);
        let sums = sums.run(&[x, &of_z, mean])?.sum(0)?;
        let (of_bias, of_weight) = (sums.get(0)?, (sums.get(1)? * inverse)?);
        let each = (scale / -(pixels as f64))?;
        let of_input = ((&each * inverse)? * &of_weight)?;
        let constant = (each * &of_bias)?;
        let linear = Tensor::stack(&[mean, scale, &of_input, &constant], 0)?;
        let launch = of_values("normalise_of_input", &self.shape);
        let of_x = launch.run(&[x, &of_z, &linear])?;
        let of_affine = Tensor::stack(&[of_weight, of_bias], 0)?;
        Ok((Some(of_x), Some(of_affine)))
    }
}
