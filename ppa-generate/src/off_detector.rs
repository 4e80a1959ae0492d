//! Whether the radiograph of a pose shows the joint.

use nalgebra::Point3;
use ppa_dataset::findings::{Finding, FindingCode, Severity};
use ppa_xray::Projection;

/// Finding that a joint (`ct` frame) is projected outside the detector.
pub(crate) fn off_detector(projection: &Projection, joint: &Point3<f64>) -> Option<Finding> {
    let in_device = projection.ct_from_device.inverse() * joint;
    let magnification = projection.source_detector_mm / in_device.z;
    let detector = &projection.detector;
    let sides = [
        (in_device.x, detector.columns, detector.centre_mm[0]),
        (in_device.y, detector.rows, detector.centre_mm[1]),
    ];
    let beyond = sides.map(|(at, pixels, centre_mm)| {
        let from_centre_mm = (magnification * at - centre_mm).abs();
        from_centre_mm - 0.5 * f64::from(pixels) * detector.pixel_mm
    });
    let beyond_mm = beyond[0].max(beyond[1]);
    (beyond_mm > 0.0).then(|| Finding {
        code: FindingCode::JointOffDetector,
        severity: Severity::Severe,
        text: format!("the joint lies {beyond_mm:.0} mm outside the radiograph"),
        value: Some(beyond_mm),
        place_mm: Some((*joint).into()),
    })
}

#[cfg(test)]
mod tests {
    use nalgebra::Isometry3;
    use ppa_xray::Detector;

    use super::*;

    #[test]
    fn a_joint_is_reported_where_its_shadow_misses_the_detector() {
        // Magnification 2: 100 mm of the joint's plane to either side.
        let detector = Detector::centred(40, 20, 10.0);
        let projection = Projection::new(Isometry3::identity(), 1000.0, detector);
        let beyond = |x, y| {
            let found = off_detector(&projection, &Point3::new(x, y, 500.0));
            found.and_then(|finding| finding.value)
        };
        assert_eq!(beyond(99.0, -49.0), None);
        assert_eq!(beyond(105.0, 0.0), Some(10.0));
        assert_eq!(beyond(0.0, -60.0), Some(20.0));
    }
}
