//! Source, field and detector of one exposure, and their pose relative to the CT.

use nalgebra::{Isometry3, Point3, Unit, UnitQuaternion, Vector3};

use crate::beam::detector::Detector;
use crate::beam::field::Field;
use crate::beam::marker::SideMarker;
use crate::beam::projection_error::ProjectionError;
use crate::beam::raster::MAX_PIXELS;
use crate::beam::receptor::Receptor;
use crate::beam::source::{Collimation, Extrafocal, Source};
use crate::setters::setters;

/// One exposure: source, field and detector, and their pose relative to the CT.
///
/// The device frame has the source (the middle of the focal spot) at the origin and z perpendicular to the detector plane.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Projection {
    /// Pose of the device in the `ct` frame, mm.
    pub ct_from_device: Isometry3<f64>,
    /// Distance from the source to the detector plane, mm, along z.
    pub source_detector_mm: f64,
    /// The detector.
    pub detector: Detector,
    /// Direction of the tube's central ray in the device frame; z unless the detector is tilted. It defines the plane of the
    /// focal spot and the geometry of the heel effect.
    pub central_ray: Unit<Vector3<f64>>,
    /// Focal spot, heel effect and collimation.
    pub source: Source,
    /// Grid and converter in the detector plane.
    pub receptor: Receptor,
    /// Lead letter on the detector.
    pub marker: Option<SideMarker>,
}

setters!(Projection {
    with_ct_from_device: ct_from_device = Isometry3<f64>,
    with_source_detector_mm: source_detector_mm = f64,
    with_detector: detector = Detector,
    with_central_ray: central_ray = Unit<Vector3<f64>>,
    with_source: source = Source,
    with_receptor: receptor = Receptor,
    with_marker: marker = impl Into<Option<SideMarker>>,
});

/// Width of the penumbra of extrafocal radiation over the shorter side of the field beyond which next to no photon would pass the blades.
const MOST_PENUMBRA: f64 = 20.0;

impl Projection {
    /// A point source that emits photons uniformly in solid angle towards the detector, which absorbs all their energy.
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
            marker: None,
        }
    }

    /// The same tube with the detector rotated about its centre: first about device x, then about device y, radians.
    ///
    /// The device frame rotates with the detector; tube and patient do not move. A rectangular field and the side marker keep their
    /// place relative to the detector's centre; a fan is about the new z axis.
    #[must_use]
    pub fn with_detector_turned(&self, about_x: f64, about_y: f64) -> Self {
        let turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), about_y)
            * UnitQuaternion::from_axis_angle(&Vector3::x_axis(), about_x);
        let [x, y] = self.detector.centre_mm;
        let centre = turn.inverse() * Vector3::new(x, y, self.source_detector_mm);
        let moved = |[at_x, at_y]: [f64; 2]| [at_x + centre.x - x, at_y + centre.y - y];
        let mut source = self.source;
        if let Collimation::Rectangle { centre_mm, .. } = &mut source.collimation {
            *centre_mm = moved(*centre_mm);
        }
        let mut marker = self.marker;
        if let Some(marker) = &mut marker {
            marker.centre_mm = moved(marker.centre_mm);
        }
        Self {
            ct_from_device: self.ct_from_device * turn,
            source_detector_mm: centre.z,
            detector: Detector {
                centre_mm: [centre.x, centre.y],
                ..self.detector
            },
            central_ray: turn.inverse() * self.central_ray,
            source,
            marker,
            ..self.clone()
        }
    }

    /// Checks lengths and counts. Conditions that depend on the phantom are checked together with the phantom.
    ///
    /// # Errors
    /// [`ProjectionError`] naming the invalid number.
    pub fn validate(&self) -> Result<(), ProjectionError> {
        let Detector {
            columns,
            rows,
            pixel_mm,
            centre_mm,
        } = self.detector;
        let pose = self.ct_from_device.to_matrix();
        for (what, numbers) in [
            ("device pose", pose.as_slice()),
            ("central ray", self.central_ray.as_slice()),
            ("centre of the detector", &centre_mm),
        ] {
            if !numbers.iter().all(|number| number.is_finite()) {
                return Err(ProjectionError::NotFinite { what });
            }
        }
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
        self.check_blades(&field)?;
        self.check_extrafocal()?;
        if let Some(marker) = &self.marker {
            marker.check(&self.detector)?;
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
        if self.central_ray.z < 0.1 {
            return Err(ProjectionError::CentralRay {
                angle_deg: self.central_ray.z.acos().to_degrees(),
            });
        }
        Ok(())
    }

    /// Refuses extrafocal radiation out of proportion, and any without blades: sharp edges would hide it.
    fn check_extrafocal(&self) -> Result<(), ProjectionError> {
        let Some(Extrafocal { ratio, size_mm }) = self.source.extrafocal else {
            return Ok(());
        };
        let most_mm = 0.1 * self.source_detector_mm;
        let possible = ratio > 0.0 && ratio <= 1.0 && size_mm > 0.0 && size_mm <= most_mm;
        if !possible {
            return Err(ProjectionError::Extrafocal {
                ratio,
                size_mm,
                most_mm,
            });
        }
        let Some(blades_mm) = self.source.blades_mm else {
            return Err(ProjectionError::ExtrafocalWithoutBlades);
        };
        let penumbra_mm = size_mm * (self.source_detector_mm / blades_mm - 1.0);
        let field_mm = self.field().size_mm();
        let most_mm = MOST_PENUMBRA * field_mm[0].min(field_mm[1]);
        if penumbra_mm > most_mm {
            return Err(ProjectionError::ExtrafocalPenumbra {
                penumbra_mm,
                most_mm,
            });
        }
        Ok(())
    }

    /// Checks that some part of the field sees the entire focal spot past the blades.
    fn check_blades(&self, field: &Field) -> Result<(), ProjectionError> {
        let Some(blades_mm) = self.source.blades_mm else {
            return Ok(());
        };
        let source_detector_mm = self.source_detector_mm;
        // The edges of the field shift by D/b − 1 per mm of the spot.
        let half_mm = 0.5 * field.size_mm()[0].min(field.size_mm()[1]);
        let reach_mm = self.source.focal_spot.shadow_reach_mm();
        let least_mm = source_detector_mm * reach_mm / (half_mm + reach_mm);
        if blades_mm > least_mm && blades_mm <= source_detector_mm {
            return Ok(());
        }
        Err(ProjectionError::Blades {
            blades_mm,
            least_mm,
            source_detector_mm,
        })
    }

    /// The field of the beam in the detector plane, as the middle of the focal spot sees it.
    pub(crate) fn field(&self) -> Field {
        let collimation = self.source.collimation;
        collimation.field(self.detector.field(), self.source_detector_mm)
    }

    /// Whether the pyramid from the source to the field can meet the convex hull of `corners`
    /// (device frame); false if all corners are outside one of its faces.
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

#[cfg(test)]
mod tests {
    use super::*;

    /// The detector rotated about its centre: same solid angle weight, same centre, same tube.
    #[test]
    fn a_turned_detector_stays_where_it_is() {
        let detector = Detector::centred(10, 10, 40.0);
        let straight = Projection::new(Isometry3::identity(), 1_000.0, detector);
        let turned = straight.with_detector_turned(0.4, 0.1);
        let centre = |p: &Projection| {
            let [x, y] = p.detector.centre_mm;
            p.ct_from_device * Point3::new(x, y, p.source_detector_mm)
        };
        assert!((centre(&straight) - centre(&turned)).norm() < 1e-9);
        let ray = turned.ct_from_device * turned.central_ray.into_inner();
        assert!((ray - Vector3::z()).norm() < 1e-12);
        let field = Collimation::Rectangle {
            size_mm: [150.0, 120.0],
            centre_mm: [5.0, -8.0],
        };
        let source = Source::default().with_collimation(field);
        let turned = straight.with_source(source).with_detector_turned(0.4, 0.1);
        let Collimation::Rectangle { centre_mm, .. } = turned.source.collimation else {
            panic!("{:?}", turned.source.collimation);
        };
        let [x, y] = turned.detector.centre_mm;
        assert!((centre_mm[0] - x - 5.0).abs() + (centre_mm[1] - y + 8.0).abs() < 1e-9);
        let d = turned.source_detector_mm;
        assert!((d - 1_000.0 * 0.4_f64.cos() * 0.1_f64.cos()).abs() < 1e-9);
    }
}
