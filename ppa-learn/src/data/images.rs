//! Prepared images of samples, read when first needed and cached up to a memory limit.

use std::borrow::Cow;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicUsize, Ordering};

use super::error::DataError;
use super::prepare::prepared_side;
use super::raster::Raster;
use super::sample::Sample;

/// Samples with their prepared images.
#[derive(Debug)]
pub struct Images {
    samples: Vec<Sample>,
    side: usize,
    kept: Vec<OnceLock<Vec<Raster<u16>>>>,
    bytes_left: AtomicUsize,
}

impl Images {
    /// Takes samples for a network of `side` x `side` inputs; keeps up to `keep_bytes` of prepared images in memory.
    ///
    /// # Errors
    /// [`DataError::Empty`] if there are no samples.
    pub fn new(samples: Vec<Sample>, side: usize, keep_bytes: usize) -> Result<Self, DataError> {
        if samples.is_empty() {
            return Err(DataError::Empty("to load".into()));
        }
        Ok(Self {
            kept: samples.iter().map(|_| OnceLock::new()).collect(),
            samples,
            side,
            bytes_left: AtomicUsize::new(keep_bytes),
        })
    }

    /// Returns the samples.
    pub fn samples(&self) -> &[Sample] {
        &self.samples
    }

    /// Returns the columns and rows of the network's input.
    pub fn side(&self) -> usize {
        self.side
    }

    /// Returns the prepared images of a sample, one for each camera.
    ///
    /// # Errors
    /// [`DataError`] naming the file that cannot be used.
    pub fn get(&self, sample: usize) -> Result<Cow<'_, [Raster<u16>]>, DataError> {
        if let Some(images) = self.kept[sample].get() {
            return Ok(Cow::Borrowed(images));
        }
        let images = self.samples[sample].images.iter();
        let images: Vec<_> = images
            .map(|image| image.load(self.side))
            .collect::<Result<_, _>>()?;
        let bytes = images.len() * prepared_side(self.side).pow(2) * size_of::<u16>();
        let less = |left: usize| left.checked_sub(bytes);
        let order = Ordering::Relaxed;
        if self.bytes_left.fetch_update(order, order, less).is_err() {
            return Ok(Cow::Owned(images));
        }
        Ok(Cow::Borrowed(self.kept[sample].get_or_init(|| images)))
    }
}
