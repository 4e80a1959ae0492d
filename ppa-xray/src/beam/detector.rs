//! The pixels of a flat detector.

use nalgebra::Point2;
use serde::{Deserialize, Serialize};

use crate::beam::field::Field;
use crate::beam::raster::Raster;
use crate::setters::setters;

/// A flat detector perpendicular to device z. Columns run along device x, rows along device y.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct Detector {
    /// Pixels along device x.
    pub columns: u32,
    /// Pixels along device y.
    pub rows: u32,
    /// Side of the square pixels, mm.
    pub pixel_mm: f64,
    /// Centre in device x and y, mm from the foot of the perpendicular through the source.
    #[serde(default)]
    pub centre_mm: [f64; 2],
}

setters!(Detector {
    with_centre_mm: centre_mm = [f64; 2],
});

impl Detector {
    /// Returns a detector whose centre is at the foot of the perpendicular through the source.
    pub const fn centred(columns: u32, rows: u32, pixel_mm: f64) -> Self {
        Self {
            columns,
            rows,
            pixel_mm,
            centre_mm: [0.0; 2],
        }
    }

    /// Number of pixels.
    pub fn pixels(&self) -> usize {
        self.columns as usize * self.rows as usize
    }

    /// Centre of a pixel (row-major index) in device x and y, mm.
    pub fn pixel_centre_mm(&self, pixel: usize) -> Point2<f64> {
        let columns = self.columns as usize;
        let [left, top] = self.field().low_mm;
        Point2::new(
            left + ((pixel % columns) as f64 + 0.5) * self.pixel_mm,
            top + ((pixel / columns) as f64 + 0.5) * self.pixel_mm,
        )
    }

    /// Area of one pixel, cm².
    pub(crate) fn pixel_cm2(&self) -> f64 {
        self.pixel_mm * self.pixel_mm / 100.0
    }

    /// Extent along device x and y, mm.
    pub(crate) fn size_mm(&self) -> [f64; 2] {
        [self.columns, self.rows].map(|pixels| f64::from(pixels) * self.pixel_mm)
    }

    /// The rectangle that the detector covers.
    pub(crate) fn field(&self) -> Field {
        Field::centred(self.centre_mm, self.size_mm())
    }

    pub(crate) fn raster(&self) -> Raster {
        Raster {
            columns: self.columns as usize,
            rows: self.rows as usize,
            centre_mm: self.centre_mm,
            extent_mm: self.size_mm(),
        }
    }
}
