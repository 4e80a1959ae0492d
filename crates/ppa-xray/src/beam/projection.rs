//! Point source, rectangular detector, and where both stand in the CT.

use std::f64::consts::TAU;

use nalgebra::{Isometry3, Point2, Point3, Vector3};
use serde::{Deserialize, Serialize};

use crate::philox::Philox;
use crate::transport::tally::Raster;

/// Why a projection cannot be simulated.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ProjectionError {
    /// The detector has no pixels, or more than can be addressed.
    #[error("the detector has {columns} x {rows} pixels; each side needs 1 to 65536")]
    PixelCount {
        /// Pixels along device x.
        columns: u32,
        /// Pixels along device y.
        rows: u32,
    },
    /// Pixel side or source-detector distance is not a length that makes sense.
    #[error("{what} is {found_mm} mm, expected 0.001 mm to 1 km")]
    Length {
        /// Which length.
        what: &'static str,
        /// What it was.
        found_mm: f64,
    },
    /// The field is nearly a half-space.
    #[error(
        "the detector reaches {half_mm} mm from the central beam at {source_detector_mm} mm from the source, expected at most ten times that distance"
    )]
    FieldTooWide {
        /// Half the longer side of the detector.
        half_mm: f64,
        /// Distance from the source to the detector plane.
        source_detector_mm: f64,
    },
    /// The device pose holds NaN or infinity.
    #[error("the device pose is not finite")]
    Pose,
    /// Not one ray of the field can meet the voxel box.
    #[error("the x-ray field misses the voxel box altogether")]
    FieldMissesPhantom,
    /// Tissue would lie behind the detector plane.
    #[error(
        "the detector cuts through the patient: voxel {voxel:?} of {density_g_cm3} g/cm³ lies {depth_mm:.1} mm behind its plane"
    )]
    DetectorInsidePhantom {
        /// The offending voxel (i, j, k).
        voxel: [usize; 3],
        /// Its density.
        density_g_cm3: f32,
        /// Distance of its centre behind the plane.
        depth_mm: f64,
    },
    /// The focal spot would lie in tissue.
    #[error("the x-ray source lies inside voxel {voxel:?} of {density_g_cm3} g/cm³")]
    SourceInsidePhantom {
        /// The offending voxel (i, j, k).
        voxel: [usize; 3],
        /// Its density.
        density_g_cm3: f32,
    },
}

/// A flat detector centred on the central beam; columns run along device x, rows along device y.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Detector {
    /// Pixels along device x.
    pub columns: u32,
    /// Pixels along device y.
    pub rows: u32,
    /// Side of the square pixels, mm.
    pub pixel_mm: f64,
}

impl Detector {
    /// Number of pixels.
    pub fn pixels(&self) -> usize {
        self.columns as usize * self.rows as usize
    }

    /// Half extent along device x and y, mm.
    pub(crate) fn half_mm(&self) -> [f64; 2] {
        [
            0.5 * f64::from(self.columns) * self.pixel_mm,
            0.5 * f64::from(self.rows) * self.pixel_mm,
        ]
    }

    /// Area of one pixel, cm².
    pub(crate) fn pixel_cm2(&self) -> f64 {
        self.pixel_mm * self.pixel_mm / 100.0
    }

    pub(crate) fn raster(&self) -> Raster {
        Raster {
            columns: self.columns as usize,
            rows: self.rows as usize,
            extent_mm: self.half_mm().map(|half| 2.0 * half),
        }
    }
}

/// One exposure: a point source that fills the detector rectangle evenly in solid angle.
#[derive(Debug, Clone, PartialEq)]
pub struct Projection {
    /// Pose of the device (source at the origin, z along the central beam) in the `ct` frame, mm.
    pub ct_from_device: Isometry3<f64>,
    /// Distance from the source to the detector plane, mm.
    pub source_detector_mm: f64,
    /// The detector.
    pub detector: Detector,
}

impl Projection {
    /// Checks lengths and counts; what depends on the phantom is checked with the phantom.
    ///
    /// # Errors
    /// [`ProjectionError`] naming the number at fault.
    pub fn validate(&self) -> Result<(), ProjectionError> {
        let Detector {
            columns,
            rows,
            pixel_mm,
        } = self.detector;
        let side = 1..=65_536;
        if !side.contains(&columns) || !side.contains(&rows) {
            return Err(ProjectionError::PixelCount { columns, rows });
        }
        for (what, found_mm) in [
            ("the pixel side", pixel_mm),
            ("the source-detector distance", self.source_detector_mm),
        ] {
            if !(1e-3..=1e6).contains(&found_mm) {
                return Err(ProjectionError::Length { what, found_mm });
            }
        }
        let [half_x, half_y] = self.detector.half_mm();
        let half_mm = half_x.max(half_y);
        if half_mm > 10.0 * self.source_detector_mm {
            return Err(ProjectionError::FieldTooWide {
                half_mm,
                source_detector_mm: self.source_detector_mm,
            });
        }
        if !self
            .ct_from_device
            .to_matrix()
            .iter()
            .all(|v| v.is_finite())
        {
            return Err(ProjectionError::Pose);
        }
        Ok(())
    }

    /// Solid angle of the field, sr: Ω = 4 atan(ab / (d √(a² + b² + d²))) for half sides a, b.
    pub fn solid_angle_sr(&self) -> f64 {
        let [a, b] = self.detector.half_mm();
        let d = self.source_detector_mm;
        4.0 * (a * b / (d * (a * a + b * b + d * d).sqrt())).atan()
    }

    /// Fluence per history on the bare detector plane at device (x, y), 1/cm²: cos³θ / (Ω d²).
    pub(crate) fn open_fluence_cm2(&self, at_mm: Point2<f64>) -> f64 {
        let d = self.source_detector_mm;
        let cos = d / (d * d + at_mm.coords.norm_squared()).sqrt();
        100.0 * cos.powi(3) / (self.solid_angle_sr() * d * d)
    }

    /// Unit vector in the device frame, uniform in solid angle over the field.
    ///
    /// A point uniform on the rectangle has density ∝ r³/d per solid angle; keeping it with
    /// probability cos³θ makes it uniform.
    pub(crate) fn sample_direction(&self, rng: &mut Philox) -> Vector3<f64> {
        let [half_x, half_y] = self.detector.half_mm();
        let d = self.source_detector_mm;
        loop {
            let x = half_x * (2.0 * rng.unit() - 1.0);
            let y = half_y * (2.0 * rng.unit() - 1.0);
            let cos = d / (x * x + y * y + d * d).sqrt();
            if rng.unit() < cos * cos * cos {
                return Vector3::new(x, y, d) * (cos / d);
            }
        }
    }

    /// Whether the pyramid from the source to the detector can meet the convex hull of `corners`
    /// (device frame): false when all lie outside one of its faces.
    pub(crate) fn field_may_meet(&self, corners: &[Point3<f64>]) -> bool {
        let [half_x, half_y] = self.detector.half_mm();
        let d = self.source_detector_mm;
        let outward = [
            (Vector3::new(d, 0.0, -half_x), 0.0),
            (Vector3::new(-d, 0.0, -half_x), 0.0),
            (Vector3::new(0.0, d, -half_y), 0.0),
            (Vector3::new(0.0, -d, -half_y), 0.0),
            (Vector3::new(0.0, 0.0, -1.0), 0.0),
            (Vector3::new(0.0, 0.0, 1.0), d),
        ];
        outward.iter().all(|(normal, offset)| {
            corners
                .iter()
                .any(|corner| normal.dot(&corner.coords) <= *offset)
        })
    }
}

/// The unit vector at polar angle arccos(`cos_theta`) and a random azimuth from `direction`.
pub(crate) fn scattered(
    direction: &Vector3<f64>,
    cos_theta: f64,
    rng: &mut Philox,
) -> Vector3<f64> {
    let (sin_phi, cos_phi) = (TAU * rng.unit()).sin_cos();
    let sin_theta = (1.0 - cos_theta * cos_theta).max(0.0).sqrt();
    // Orthonormal basis without a branch near the pole (Duff et al., JCGT 6(1), 2017).
    let [x, y, z] = (*direction).into();
    let sign = 1.0_f64.copysign(z);
    let a = -1.0 / (sign + z);
    let b = x * y * a;
    let first = Vector3::new(1.0 + sign * x * x * a, sign * b, -sign * x);
    let second = Vector3::new(b, sign + y * y * a, -y);
    (first * (sin_theta * cos_phi) + second * (sin_theta * sin_phi) + direction * cos_theta)
        .normalize()
}
