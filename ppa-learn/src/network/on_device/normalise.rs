//! Batch normalisation and the activation after it, with their gradients (Ioffe and Szegedy 2015, arXiv:1502.03167).

use candle_core::{Result, Shape, Tensor};

use super::reduce;
use crate::device::launch::Launch;

/// Bit flags of the terms of a value, as in `kernels.cu`.
const IMAGE: usize = 1;
const FACTOR: usize = 2;
const ADDEND: usize = 4;
const ACTIVATED: usize = 8;

/// The output of a convolution, and its normalisation z = scale (x - mean) + bias.
pub struct Normed {
    /// [images, rows, columns, channels]
    x: Tensor,
    /// [mean, scale, bias, 1 / sigma and unbiased variance, channels]
    norm: Tensor,
    /// Whether SiLU follows.
    activated: bool,
}

/// The gradient of a normalised image [images, rows, columns, channels]: image x factor + addend, the last two [images, channels].
#[derive(Clone, Copy, Default)]
pub struct Gradient<'a> {
    pub image: Option<&'a Tensor>,
    pub factor: Option<&'a Tensor>,
    pub addend: Option<&'a Tensor>,
}

impl Normed {
    /// Normalises by the moments of x itself; affine is [weight and bias, channels].
    pub fn by_batch(x: Tensor, affine: &Tensor, activated: bool) -> Result<Self> {
        let (pixels, channels) = size(&x);
        let parts = reduce::parts(channels, pixels);
        let sizes = [pixels, channels, parts];
        let launch = Launch::new("moments", (parts, 2, channels), parts * channels, &sizes);
        let sums = reduce::sum(launch.run(&[&x])?)?;
        let launch = Launch::new("norm_of_batch", (5, channels), channels, &[pixels]);
        let norm = launch.run(&[&sums, &x, affine])?;
        Ok(Self { x, norm, activated })
    }

    /// Normalises by moments [channels] that do not depend on x.
    pub fn by_moments(
        x: Tensor,
        affine: &Tensor,
        mean: &Tensor,
        variance: &Tensor,
        activated: bool,
    ) -> Result<Self> {
        let (_, channels) = size(&x);
        let launch = Launch::new("norm_of_moments", (5, channels), channels, &[]);
        let norm = launch.run(&[mean, variance, affine])?;
        Ok(Self { x, norm, activated })
    }

    /// Returns mean and unbiased variance, both [channels].
    pub fn moments(&self) -> Result<[Tensor; 2]> {
        Ok([self.norm.get(0)?, self.norm.get(4)?])
    }

    pub fn shape(&self) -> &Shape {
        self.x.shape()
    }

    /// Returns the number of pixels of an image.
    pub fn pixels(&self) -> usize {
        let dims = self.x.dims();
        dims[1] * dims[2]
    }

    /// Computes the normalised and activated image, times a factor [images, channels], plus another image.
    pub fn image(&self, factor: Option<&Tensor>, addend: Option<&Tensor>) -> Result<Tensor> {
        let (_, channels) = size(&self.x);
        let form = given(factor, FACTOR) | given(addend, ADDEND) | self.form();
        let sizes = [self.pixels(), channels, form];
        let launch = Launch::of_values("normalise", self.shape(), &sizes);
        let norm = &self.norm;
        launch.run(&[
            &self.x,
            norm,
            factor.unwrap_or(norm),
            addend.unwrap_or(norm),
        ])
    }

    /// Computes the means [images, channels] of the activated image.
    pub fn mean(&self) -> Result<Tensor> {
        self.pool(None)
    }

    /// Computes the sums [images, channels] of the activated image times another one.
    pub fn dot(&self, image: &Tensor) -> Result<Tensor> {
        self.pool(Some(image))
    }

    fn pool(&self, image: Option<&Tensor>) -> Result<Tensor> {
        debug_assert!(self.activated, "the kernel applies SiLU");
        let (_, channels) = size(&self.x);
        let (images, pixels) = (self.x.dim(0)?, self.pixels());
        let values = images * channels;
        let parts = reduce::parts(values, pixels);
        let form = given(image, IMAGE);
        let sizes = [values, pixels, channels, parts, form];
        let launch = Launch::of_values("pool", (parts, images, channels), &sizes);
        let norm = &self.norm;
        reduce::sum(launch.run(&[&self.x, norm, image.unwrap_or(norm)])?)
    }

    /// Computes the gradients of x and of affine [weight and bias, channels] for a normalisation by the batch.
    pub fn gradients(&self, of: Gradient) -> Result<(Tensor, Tensor)> {
        let (all_pixels, channels) = size(&self.x);
        let (x, norm, pixels) = (&self.x, &self.norm, self.pixels());
        let form = given(of.image, IMAGE)
            | given(of.factor, FACTOR)
            | given(of.addend, ADDEND)
            | self.form();
        let [image, factor, addend] =
            [of.image, of.factor, of.addend].map(|term| term.unwrap_or(norm));

        let parts = reduce::parts(channels, all_pixels);
        let launch = Launch::new(
            "normalise_of_affine",
            (parts, 2, channels),
            parts * channels,
            &[all_pixels, pixels, channels, form, parts],
        );
        let sums = reduce::sum(launch.run(&[x, norm, image, factor, addend])?)?;
        let launch = Launch::new("normalise_of_sums", (4, channels), channels, &[all_pixels]);
        let of_sums = launch.run(&[&sums, norm])?;
        let sizes = [pixels, channels, form];
        let launch = Launch::of_values("normalise_of_input", x.shape(), &sizes);
        let of_x = launch.run(&[x, norm, image, factor, addend, &of_sums])?;
        Ok((of_x, of_sums.narrow(0, 0, 2)?))
    }

    fn form(&self) -> usize {
        if self.activated { ACTIVATED } else { 0 }
    }
}

/// Returns the number of pixels of all images, and of channels.
fn size(x: &Tensor) -> (usize, usize) {
    let channels = *x.dims().last().expect("images have channels");
    (x.elem_count() / channels, channels)
}

/// Returns the flag of a term if it is given, otherwise 0.
fn given(term: Option<&Tensor>, number: usize) -> usize {
    term.map_or(0, |_| number)
}
