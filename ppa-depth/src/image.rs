//! Depth images in memory.

use std::path::PathBuf;

use crate::camera::projection::Camera;

/// Depth along the camera's z axis in mm, row-major from the top left; 0 where nothing was seen.
#[derive(Debug, Clone, PartialEq)]
pub struct DepthImage {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `width * height` depths in mm.
    pub z_mm: Vec<f32>,
}

/// A depth image in whole millimetres, as stored in 16-bit files.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DepthU16 {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `width * height` depths in mm; 0 is invalid.
    pub z_mm: Vec<u16>,
    /// Pixels that were too far for 16 bits (65.535 m) and became 0.
    pub too_far: usize,
}

/// Errors of depth images.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DepthError {
    /// No pixel has a depth.
    #[error(
        "the camera sees nothing: none of the {width} x {height} pixels has a depth (check the camera's pose)"
    )]
    NothingVisible {
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
    },
    /// The sensor rejected all pixels.
    #[error(
        "the sensor measures nothing: it rejects all {seen} pixels that see a surface (too dim, too oblique or at edges)"
    )]
    NothingMeasured {
        /// Pixels that have a depth without the sensor.
        seen: usize,
    },
    /// No depth fits into 16 bits.
    #[error(
        "{} cannot hold depths beyond 65.535 m, and all {pixels} pixels that see a surface are farther", path.display()
    )]
    TooFar {
        /// The file.
        path: PathBuf,
        /// Pixels with a depth.
        pixels: usize,
    },
    /// Something else hides the entire surface.
    #[error(
        "the surface is hidden: something is in front of it in all of its {pixels} pixels (check the poses)"
    )]
    Hidden {
        /// Number of pixels that it would cover.
        pixels: usize,
    },
    /// Two images that belong together differ in size.
    #[error("depth images of {} x {} and {} x {} pixels differ in size", first[0], first[1], second[0], second[1])]
    SizeMismatch {
        /// Columns and rows of the first image.
        first: [u32; 2],
        /// Columns and rows of the second image.
        second: [u32; 2],
    },
    /// An image is not of the size of a camera's images.
    #[error("the depth image has {} x {} pixels, but images of the camera have {} x {}", found[0], found[1], expected[0], expected[1])]
    OtherCamera {
        /// Columns and rows of the image.
        found: [u32; 2],
        /// Columns and rows of the camera.
        expected: [u32; 2],
    },
    /// The number of depths is not columns times rows.
    #[error("depth image of {width} x {height} pixels with {found} depths")]
    Length {
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
        /// Depths found.
        found: usize,
    },
    /// The file cannot be written.
    #[error("cannot write {}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The file cannot be read.
    #[error("cannot read {}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Error of the operating system or the decoder.
        source: std::io::Error,
    },
    /// The PNG is not a 16-bit grey image.
    #[error("{} holds {found} pixels, expected 16-bit grey", path.display())]
    PixelFormat {
        /// The file.
        path: PathBuf,
        /// Colour type and bit depth found.
        found: String,
    },
}

impl DepthImage {
    /// An image in which nothing was seen.
    pub fn empty(width: u32, height: u32) -> Self {
        Self {
            width,
            height,
            z_mm: vec![0.0; width as usize * height as usize],
        }
    }

    /// Number of pixels with a depth.
    pub fn valid_pixels(&self) -> usize {
        self.valid().count()
    }

    /// Smallest depth in mm, of the pixels that have one.
    pub fn min_mm(&self) -> Option<f32> {
        self.valid().reduce(f32::min)
    }

    /// Largest depth in mm, of the pixels that have one.
    pub fn max_mm(&self) -> Option<f32> {
        self.valid().reduce(f32::max)
    }

    fn valid(&self) -> impl Iterator<Item = f32> {
        self.z_mm.iter().copied().filter(|z_mm| *z_mm > 0.0)
    }

    /// Returns an error if no pixel has a depth.
    ///
    /// # Errors
    /// [`DepthError::NothingVisible`].
    pub fn require_visible(&self) -> Result<(), DepthError> {
        match self.valid().next() {
            Some(_) => Ok(()),
            None => Err(DepthError::NothingVisible {
                width: self.width,
                height: self.height,
            }),
        }
    }

    /// Returns an error if an image of a sensor has no depth; `seen` pixels see a surface.
    ///
    /// # Errors
    /// [`DepthError::NothingMeasured`].
    pub fn require_measured(&self, seen: usize) -> Result<(), DepthError> {
        match self.valid().next() {
            Some(_) => Ok(()),
            None => Err(DepthError::NothingMeasured { seen }),
        }
    }

    /// The nearer depth per pixel of two images of one camera: a background rendered once, merged with each pose of a limb.
    ///
    /// # Errors
    /// [`DepthError::SizeMismatch`].
    pub fn nearer_of(first: &Self, second: &Self) -> Result<Self, DepthError> {
        let size = |image: &Self| [image.width, image.height];
        if size(first) != size(second) || first.z_mm.len() != second.z_mm.len() {
            return Err(DepthError::SizeMismatch {
                first: size(first),
                second: size(second),
            });
        }
        let nearer = |(&a, &b): (&f32, &f32)| match (a > 0.0, b > 0.0) {
            (true, true) => a.min(b),
            (true, false) => a,
            (false, true) => b,
            (false, false) => 0.0,
        };
        let z_mm = first.z_mm.iter().zip(&second.z_mm).map(nearer).collect();
        Ok(Self {
            width: first.width,
            height: first.height,
            z_mm,
        })
    }

    /// Puts this image in front of a background of the same camera by [`nearer_of`](Self::nearer_of); some of it must remain.
    ///
    /// # Errors
    /// [`DepthError::NothingVisible`] if nothing is seen without the background, [`DepthError::Hidden`] if all is behind it,
    /// [`DepthError::SizeMismatch`].
    pub fn before(&self, background: &Self) -> Result<Self, DepthError> {
        self.require_visible()?;
        let merged = Self::nearer_of(background, self)?;
        let mut pairs = self.z_mm.iter().zip(&merged.z_mm);
        if pairs.any(|(own, merged)| *own > 0.0 && own == merged) {
            return Ok(merged);
        }
        Err(DepthError::Hidden {
            pixels: self.valid_pixels(),
        })
    }

    /// Depths rounded to whole millimetres. Those beyond 65 535 mm become 0 and are counted.
    pub fn to_u16(&self) -> DepthU16 {
        let mut too_far = 0;
        let round = |&z_mm: &f32| {
            let rounded = z_mm.round();
            let fits = rounded <= f32::from(u16::MAX);
            too_far += usize::from(!fits);
            if fits { rounded as u16 } else { 0 }
        };
        let z_mm = self.z_mm.iter().map(round).collect();
        DepthU16 {
            width: self.width,
            height: self.height,
            z_mm,
            too_far,
        }
    }

    /// Returns an error if the image is not of the camera's size.
    pub(crate) fn check_camera(&self, camera: &Camera) -> Result<(), DepthError> {
        let (first, second) = ([camera.width(), camera.height()], [self.width, self.height]);
        if first != second {
            return Err(DepthError::SizeMismatch { first, second });
        }
        self.check_length()
    }

    /// Returns an error if the buffer does not fit the size, before a file is begun.
    pub(crate) fn check_length(&self) -> Result<(), DepthError> {
        if self.z_mm.len() == self.width as usize * self.height as usize {
            return Ok(());
        }
        Err(DepthError::Length {
            width: self.width,
            height: self.height,
            found: self.z_mm.len(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(z_mm: &[f32]) -> DepthImage {
        DepthImage {
            width: z_mm.len() as u32,
            height: 1,
            z_mm: z_mm.to_vec(),
        }
    }

    #[test]
    fn the_nearer_surface_wins_and_zero_is_no_surface() {
        let merged = DepthImage::nearer_of(
            &image(&[0.0, 0.0, 5.0, 5.0, 5.0]),
            &image(&[0.0, 7.0, 0.0, 3.0, 9.0]),
        );
        assert_eq!(merged.unwrap().z_mm, [0.0, 7.0, 5.0, 3.0, 5.0]);
        let mismatch = DepthImage::nearer_of(&image(&[1.0]), &image(&[1.0, 2.0]));
        assert!(matches!(mismatch, Err(DepthError::SizeMismatch { .. })));
    }

    #[test]
    fn millimetres_are_rounded_and_what_does_not_fit_is_counted() {
        let rounded = image(&[0.0, 0.4, 999.5, 65_535.4, 65_535.5, 1e9]).to_u16();
        assert_eq!(rounded.z_mm, [0, 0, 1000, 65_535, 0, 0]);
        assert_eq!(rounded.too_far, 2);
    }

    #[test]
    fn an_empty_view_is_refused() {
        assert!(matches!(
            DepthImage::empty(4, 3).require_visible(),
            Err(DepthError::NothingVisible { .. })
        ));
        let seen = image(&[0.0, 800.0, 1200.0]);
        assert!(seen.require_visible().is_ok());
        assert_eq!(
            (seen.valid_pixels(), seen.min_mm(), seen.max_mm()),
            (2, Some(800.0), Some(1200.0))
        );
    }
}
