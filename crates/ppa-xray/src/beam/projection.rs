//! Source, field and rectangular detector of one exposure, and where they stand in the CT.

use nalgebra::{Isometry3, Point2, Point3, Unit, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use crate::beam::emitter::Emitter;
use crate::beam::field::Field;
use crate::beam::source::{Collimation, Source};
use crate::beam::spectrum::Spectrum;
use crate::detector::receptor::{Receptor, ReceptorError};
use crate::transport::tally::Raster;

/// Most pixels of a detector: 2²⁸, whose planes take 8 GiB.
const MAX_PIXELS: usize = 1 << 28;

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
    /// The planes of such an image would not fit into memory.
    #[error(
        "the detector has {columns} x {rows} pixels, expected at most {MAX_PIXELS}: each takes 32 bytes in the result"
    )]
    TooManyPixels {
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
    /// The focal spot is no size, or out of proportion.
    #[error(
        "the focal spot is {size_mm} mm wide at {source_detector_mm} mm from the detector, expected 0 to 2 % of that distance"
    )]
    FocalSpot {
        /// Its side or full width at half maximum.
        size_mm: f64,
        /// Distance from the source to the detector plane, mm.
        source_detector_mm: f64,
    },
    /// Opening angles of the fan.
    #[error("the x-ray field opens by {found_deg:?} degrees, expected above 0 and below 170")]
    FanAngle {
        /// Angles along device x and y, degrees.
        found_deg: [f64; 2],
    },
    /// Sides of the field.
    #[error(
        "the x-ray field measures {size_mm:?} mm on the detector plane, expected sides of 0.001 to 10000000 mm"
    )]
    Field {
        /// Sides along device x and y.
        size_mm: [f64; 2],
    },
    /// The field or the detector reaches nearly to the horizon.
    #[error(
        "the {what} reaches {reach_mm} mm from the foot of the source at {source_detector_mm} mm from it, expected at most ten times that distance"
    )]
    FieldTooWide {
        /// Field or detector.
        what: &'static str,
        /// Largest coordinate on the detector plane.
        reach_mm: f64,
        /// Distance from the source to the detector plane.
        source_detector_mm: f64,
    },
    /// The tube looks along the detector or away from it.
    #[error(
        "the central ray meets the detector plane at {angle_deg:.1}° from its normal, expected below 84°"
    )]
    CentralRay {
        /// Angle between central ray and device z, degrees.
        angle_deg: f64,
    },
    /// Direction of the anode.
    #[error("the anode lies towards {found_deg} degrees, expected a number")]
    Anode {
        /// What it was.
        found_deg: f64,
    },
    /// The heel effect needs the tube model.
    #[error(
        "the heel effect needs a spectrum of the tube model; this one does not say from which anode it comes"
    )]
    HeelWithoutTube,
    /// The tube model has no spectrum at a take-off angle of the field.
    #[error(
        "no spectrum at a take-off angle of {anode_angle_deg:.1}° for the heel effect: {message}"
    )]
    Heel {
        /// Take-off angle, degrees.
        anode_angle_deg: f64,
        /// What the tube model said.
        message: String,
    },
    /// The device pose holds NaN or infinity.
    #[error("the device pose is not finite")]
    Pose,
    /// The image receptor.
    #[error(transparent)]
    Receptor(#[from] ReceptorError),
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

/// A flat detector square to device z; columns run along device x, rows along device y.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
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

impl Detector {
    /// A detector whose centre faces the source.
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

    /// The rectangle it covers.
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

/// One exposure: source, field and detector, and where they stand in the CT.
///
/// The device frame has the source (the middle of the focal spot) at the origin and z square to the detector plane.
#[derive(Debug, Clone, PartialEq)]
pub struct Projection {
    /// Pose of the device in the `ct` frame, mm.
    pub ct_from_device: Isometry3<f64>,
    /// Distance from the source to the detector plane, mm, along z.
    pub source_detector_mm: f64,
    /// The detector.
    pub detector: Detector,
    /// Direction of the tube's central ray in the device frame; z unless the detector is tilted. The plane of the
    /// focal spot and the heel effect go by it.
    pub central_ray: Unit<Vector3<f64>>,
    /// Focal spot, heel effect and collimation.
    pub source: Source,
    /// Grid and converter in the detector plane.
    pub receptor: Receptor,
}

impl Projection {
    /// A point source that sends photons evenly in solid angle, all to the detector, which takes all their energy.
    pub fn new(
        ct_from_device: Isometry3<f64>,
        source_detector_mm: f64,
        detector: Detector,
    ) -> Self {
        Self {
            ct_from_device,
            source_detector_mm,
            detector,
            central_ray: Vector3::z_axis(),
            source: Source::default(),
            receptor: Receptor::default(),
        }
    }

    /// The same tube with the detector turned about its centre: first about device x, then about device y, radians.
    ///
    /// The device frame turns with the detector; tube and patient stay where they are.
    #[must_use]
    pub fn with_detector_turned(&self, about_x: f64, about_y: f64) -> Self {
        let turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), about_y)
            * UnitQuaternion::from_axis_angle(&Vector3::x_axis(), about_x);
        let [x, y] = self.detector.centre_mm;
        let centre = turn.inverse() * Vector3::new(x, y, self.source_detector_mm);
        Self {
            ct_from_device: self.ct_from_device * turn,
            source_detector_mm: centre.z,
            detector: Detector {
                centre_mm: [centre.x, centre.y],
                ..self.detector
            },
            central_ray: turn.inverse() * self.central_ray,
            ..self.clone()
        }
    }

    /// Checks lengths and counts; what depends on the phantom is checked with the phantom.
    ///
    /// # Errors
    /// [`ProjectionError`] naming the number at fault.
    pub fn validate(&self) -> Result<(), ProjectionError> {
        let Detector {
            columns,
            rows,
            pixel_mm,
            centre_mm,
        } = self.detector;
        let side = 1..=65_536;
        if !side.contains(&columns) || !side.contains(&rows) {
            return Err(ProjectionError::PixelCount { columns, rows });
        }
        if self.detector.pixels() > MAX_PIXELS {
            return Err(ProjectionError::TooManyPixels { columns, rows });
        }
        for (what, found_mm) in [
            ("the pixel side", pixel_mm),
            ("the source-detector distance", self.source_detector_mm),
        ] {
            if !(1e-3..=1e6).contains(&found_mm) {
                return Err(ProjectionError::Length { what, found_mm });
            }
        }
        let spot_mm = self.source.focal_spot.size_mm;
        // 2 % of the distance is 20 mm at 1 m, beyond any tube.
        if !(0.0..=0.02 * self.source_detector_mm).contains(&spot_mm) {
            return Err(ProjectionError::FocalSpot {
                size_mm: spot_mm,
                source_detector_mm: self.source_detector_mm,
            });
        }
        if let Collimation::Fan { angles_deg } = self.source.collimation
            && !angles_deg.iter().all(|deg| *deg > 0.0 && *deg < 170.0)
        {
            return Err(ProjectionError::FanAngle {
                found_deg: angles_deg,
            });
        }
        let field = self.field();
        if !field
            .size_mm()
            .iter()
            .all(|side| (1e-3..=1e7).contains(side))
        {
            return Err(ProjectionError::Field {
                size_mm: field.size_mm(),
            });
        }
        for (what, rectangle) in [("detector", self.detector.field()), ("x-ray field", field)] {
            let reach_mm = rectangle.low_mm.iter().chain(&rectangle.high_mm);
            let reach_mm = reach_mm.fold(0.0, |most: f64, mm| most.max(mm.abs()));
            if reach_mm > 10.0 * self.source_detector_mm {
                return Err(ProjectionError::FieldTooWide {
                    what,
                    reach_mm,
                    source_detector_mm: self.source_detector_mm,
                });
            }
        }
        let pose = self.ct_from_device.to_matrix();
        let numbers = pose.iter().chain(self.central_ray.iter()).chain(&centre_mm);
        if !numbers.clone().all(|v| v.is_finite()) {
            return Err(ProjectionError::Pose);
        }
        if self.central_ray.z < 0.1 {
            return Err(ProjectionError::CentralRay {
                angle_deg: self.central_ray.z.acos().to_degrees(),
            });
        }
        Ok(())
    }

    /// Histories of one mAs: photons that the tube sends into the field. None if `spectrum` does not come from the
    /// tube model, which alone knows.
    ///
    /// # Errors
    /// [`ProjectionError`] when the exposure makes no sense.
    pub fn photons_per_mas(&self, spectrum: &Spectrum) -> Result<Option<f64>, ProjectionError> {
        Ok(Emitter::new(self, spectrum)?.photons_per_mas())
    }

    /// The field of the beam in the detector plane.
    pub(crate) fn field(&self) -> Field {
        let collimation = self.source.collimation;
        collimation.field(self.detector.field(), self.source_detector_mm)
    }

    /// Whether the pyramid from the source to the field can meet the convex hull of `corners`
    /// (device frame): false when all lie outside one of its faces.
    pub(crate) fn field_may_meet(&self, corners: &[Point3<f64>]) -> bool {
        let Field { low_mm, high_mm } = self.field();
        let d = self.source_detector_mm;
        let outward = [
            (Vector3::new(d, 0.0, -high_mm[0]), 0.0),
            (Vector3::new(-d, 0.0, low_mm[0]), 0.0),
            (Vector3::new(0.0, d, -high_mm[1]), 0.0),
            (Vector3::new(0.0, -d, low_mm[1]), 0.0),
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
