//! One camera of a stream.

use std::path::Path;
use std::sync::OnceLock;

use ppa_core::Roi;
use ppa_dataset::layout::View;
use ppa_dataset::published::GrayImage16;

use crate::data::{DataError, Raster, SampleImage, evaluation_input, prepare};

/// A camera whose frames all show the joint in the same region.
#[derive(Debug)]
pub(super) struct Camera {
    view: View,
    roi: Roi,
    /// Whether networks see its frames mirrored left to right.
    mirrored: bool,
    /// Columns and rows of its first frame that could be read: a region fits one size of images only.
    size: OnceLock<[usize; 2]>,
}

impl Camera {
    pub fn new(view: View, roi: Roi, mirrored: bool) -> Self {
        Self {
            view,
            roi,
            mirrored,
            size: OnceLock::new(),
        }
    }

    /// The same camera whose frames show the joint in another region.
    pub fn with_region(&self, roi: Roi) -> Self {
        Self::new(self.view, roi, self.mirrored)
    }

    /// An image as a network of `side` x `side` inputs sees it.
    pub fn input_of(&self, image: &Raster<u16>, side: usize) -> Result<Raster<f32>, DataError> {
        let prepared = prepare(image, self.roi, self.mirrored, side)?;
        Ok(evaluation_input(&prepared, side))
    }

    /// A frame as a network of `side` x `side` inputs sees it.
    pub fn input(&self, path: &Path, side: usize) -> Result<Raster<f32>, DataError> {
        let size = match self.size.get() {
            Some(&size) => size,
            None => {
                let first = GrayImage16::read(path)?;
                let size = [first.width as usize, first.height as usize];
                *self.size.get_or_init(|| size)
            }
        };
        let image = SampleImage {
            path: path.to_owned(),
            camera: self.view,
            roi: self.roi,
            size,
            mirrored: self.mirrored,
        };
        Ok(evaluation_input(&image.load(side)?, side))
    }
}
