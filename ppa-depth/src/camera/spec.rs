//! Description of one camera in files.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::camera::depth_mode::DepthMode;
use crate::camera::field_mask::FieldMask;

/// Which lens model the coefficients belong to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CameraModel {
    /// OpenCV's rational model, as in retail Azure Kinect devices: the mixed tangential terms carry a factor 2.
    BrownConrady,
    /// The variant of early Azure Kinect devices: the mixed tangential terms carry a factor 1.
    #[serde(rename = "rational_6kt")]
    Rational6Kt,
    /// No distortion; `k1`…`k6`, `p1`, `p2` must be 0.
    Pinhole,
}

/// Intrinsics of one depth camera; the camera JSON of the command line.
///
/// With x = X/Z, y = Y/Z, s = x² + y², d = (1 + k1 s + k2 s² + k3 s³) / (1 + k4 s + k5 s² + k6 s³) and m = 2
/// (`brown_conrady`) or 1 (`rational_6kt`), a point falls on the pixel
///
/// u = fx (x d + p2 (s + 2x²) + m p1 x y) + cx,  v = fy (y d + p1 (s + 2y²) + m p2 x y) + cy.
///
/// `Camera::try_from` checks the numbers. Keys that are not listed here, such as a name or a serial number, are ignored.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CameraSpec {
    /// Lens model.
    pub model: CameraModel,
    /// Columns of the image.
    pub width: u32,
    /// Rows of the image.
    pub height: u32,
    /// Focal length along x in pixels.
    pub fx: f64,
    /// Focal length along y in pixels.
    pub fy: f64,
    /// Column of the principal point; 0 is the centre of the first column.
    pub cx: f64,
    /// Row of the principal point; 0 is the centre of the first row.
    pub cy: f64,
    /// Radial, numerator, s¹.
    #[serde(default)]
    pub k1: f64,
    /// Radial, numerator, s².
    #[serde(default)]
    pub k2: f64,
    /// Radial, numerator, s³.
    #[serde(default)]
    pub k3: f64,
    /// Radial, denominator, s¹.
    #[serde(default)]
    pub k4: f64,
    /// Radial, denominator, s².
    #[serde(default)]
    pub k5: f64,
    /// Radial, denominator, s³.
    #[serde(default)]
    pub k6: f64,
    /// Tangential.
    #[serde(default)]
    pub p1: f64,
    /// Tangential.
    #[serde(default)]
    pub p2: f64,
    /// Largest √(x² + y²) for which the device gives depth; by default as far as the distortion can be inverted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub metric_radius: Option<f64>,
    /// Shape outside which the image has no depth; by default the whole image has depth.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mask: Option<FieldMask>,
}

/// Reason why a camera could not be read or is invalid.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CameraError {
    /// The file cannot be read.
    #[error("cannot read camera file {}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The file is not a camera JSON.
    #[error("{} is not a camera JSON", path.display())]
    Json {
        /// The file.
        path: PathBuf,
        /// Error of the parser, with line and column.
        source: serde_json::Error,
    },
    /// A calibration file is incomplete or describes another kind of lens.
    #[error("{} cannot be used as a depth camera: {message}", path.display())]
    Calibration {
        /// The file.
        path: PathBuf,
        /// What was found and what was expected.
        message: String,
    },
    /// No pixels, or more than the renderer's limit.
    #[error("camera image of {width} x {height} pixels, expected 1 to {max} along each side")]
    Size {
        /// Columns found.
        width: u32,
        /// Rows found.
        height: u32,
        /// Largest number of columns and of rows.
        max: u32,
    },
    /// A focal length is zero, negative or not finite.
    #[error("camera focal length {name} is {found}, expected a positive number of pixels")]
    FocalLength {
        /// `fx` or `fy`.
        name: &'static str,
        /// The value.
        found: f64,
    },
    /// Principal point or a coefficient is infinite or NaN.
    #[error("camera parameter {name} is {found}, expected a finite number")]
    NotFinite {
        /// The key.
        name: &'static str,
        /// The value.
        found: f64,
    },
    /// The metric radius is zero, negative or not finite.
    #[error("camera metric_radius is {0}, expected a positive number")]
    MetricRadius(f64),
    /// The mask has an impossible opening.
    #[error("camera mask with {name} = {found}, expected an angle between 0 and 180 degrees")]
    Mask {
        /// The key.
        name: &'static str,
        /// The value.
        found: f64,
    },
    /// A pinhole camera with a distortion coefficient.
    #[error("camera model pinhole with {name} = {found}, expected 0 (or another model)")]
    DistortedPinhole {
        /// The key.
        name: &'static str,
        /// The value.
        found: f64,
    },
}

impl CameraSpec {
    /// Largest number of columns or rows of an image.
    pub(crate) const MAX_SIDE: u32 = 16_384;

    /// A camera with OpenCV's rational lens: size in pixels, focal lengths and principal point, k1 to k6, p1 and p2.
    pub(crate) fn brown_conrady(
        [width, height]: [u32; 2],
        [fx, fy, cx, cy]: [f64; 4],
        [k1, k2, k3, k4, k5, k6]: [f64; 6],
        [p1, p2]: [f64; 2],
    ) -> Self {
        Self {
            model: CameraModel::BrownConrady,
            width,
            height,
            fx,
            fy,
            cx,
            cy,
            k1,
            k2,
            k3,
            k4,
            k5,
            k6,
            p1,
            p2,
            metric_radius: None,
            mask: None,
        }
    }

    /// An Azure Kinect in one of its depth modes, without the mode's [mask](DepthMode::mask).
    ///
    /// Numbers of the calibration in the unit tests of the public Azure Kinect Sensor SDK
    /// (`ut_calibration_data.h`, github.com/microsoft/Azure-Kinect-Sensor-SDK, MIT), taken from unit scale to pixels of
    /// the mode: c = c01 · side − crop − 0.5, f = f01 · side.
    pub fn azure_kinect(mode: DepthMode) -> Self {
        let window = mode.window();
        let [width, height] = window.size;
        let scale = window.sensor / 1024.0;
        let centre = |sensor_px: f64, crop: f64| (sensor_px + 0.5) * scale - crop - 0.5;
        Self {
            model: CameraModel::BrownConrady,
            width,
            height,
            fx: 504.647_369_384_765_6 * scale,
            fy: 504.757_385_253_906_25 * scale,
            cx: centre(513.738_281_25, window.crop[0]),
            cy: centre(513.338_439_941_406_3, window.crop[1]),
            k1: 0.582_516_431_808_471_7,
            k2: 0.006_136_116_571_724_415,
            k3: -0.001_318_680_238_910_019_4,
            k4: 0.925_613_462_924_957_3,
            k5: 0.125_689_774_751_663_2,
            k6: -0.006_530_247_628_688_812,
            p1: -0.000_128_779_167_425_818_74,
            p2: -2.083_355_684_590_060_3e-5,
            metric_radius: Some(1.737_323_045_730_591),
            mask: None,
        }
    }

    /// Reads a camera JSON. The numbers are checked by `Camera::try_from`.
    ///
    /// # Errors
    /// [`CameraError::Read`] or [`CameraError::Json`].
    pub fn read(path: &Path) -> Result<Self, CameraError> {
        let text =
            ppa_core::regular_file::read_to_string(path).map_err(|source| CameraError::Read {
                path: path.into(),
                source,
            })?;
        serde_json::from_str(&text).map_err(|source| CameraError::Json {
            path: path.into(),
            source,
        })
    }

    pub(crate) fn check(&self) -> Result<(), CameraError> {
        let side = 1..=Self::MAX_SIDE;
        if !(side.contains(&self.width) && side.contains(&self.height)) {
            let (width, height) = (self.width, self.height);
            return Err(CameraError::Size {
                width,
                height,
                max: Self::MAX_SIDE,
            });
        }
        for (name, found) in [("fx", self.fx), ("fy", self.fy)] {
            if !(found.is_finite() && 0.0 < found) {
                return Err(CameraError::FocalLength { name, found });
            }
        }
        let coefficients = [
            ("k1", self.k1),
            ("k2", self.k2),
            ("k3", self.k3),
            ("k4", self.k4),
            ("k5", self.k5),
            ("k6", self.k6),
            ("p1", self.p1),
            ("p2", self.p2),
        ];
        for (name, found) in [("cx", self.cx), ("cy", self.cy)]
            .into_iter()
            .chain(coefficients)
        {
            if !found.is_finite() {
                return Err(CameraError::NotFinite { name, found });
            }
        }
        if self.model == CameraModel::Pinhole
            && let Some(&(name, found)) = coefficients.iter().find(|(_, value)| *value != 0.0)
        {
            return Err(CameraError::DistortedPinhole { name, found });
        }
        if let Some((name, found)) = self.mask.and_then(|mask| mask.bad_angle()) {
            return Err(CameraError::Mask { name, found });
        }
        match self.metric_radius {
            Some(radius) if !(radius.is_finite() && 0.0 < radius) => {
                Err(CameraError::MetricRadius(radius))
            }
            _ => Ok(()),
        }
    }
}
