//! A camera of a stream.

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
    /// Columns and rows of its first readable frame: a region is valid for one image size only.
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

    /// Returns the same camera with another region of the joint.
    pub fn with_region(&self, roi: Roi) -> Self {
        Self::new(self.view, roi, self.mirrored)
    }

    /// Converts an image to the input of a network of `side` x `side` inputs.
    pub fn input_of(&self, image: &Raster<u16>, side: usize) -> Result<Raster<f32>, DataError> {
        let prepared = prepare(image, self.roi, self.mirrored, side)?;
        Ok(evaluation_input(&prepared, side))
    }

    /// Reads a frame and converts it to the input of a network of `side` x `side` inputs.
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
