//! The region of interest around a joint.

use nalgebra::Point3;
use ppa_core::Roi;

use crate::camera::projection::Camera;

/// Reason why there is no square around a joint.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RoiError {
    /// The side is zero, negative or not finite.
    #[error("side of the region of interest is {0} mm, expected a positive number")]
    Side(f64),
    /// The joint is behind the camera or outside its field of view.
    #[error(
        "the joint at ({}, {}, {}) mm in the camera frame is behind the camera or outside its field of view",
        found_mm[0], found_mm[1], found_mm[2]
    )]
    NotInView {
        /// Position of the joint, mm.
        found_mm: [f64; 3],
    },
    /// The joint is outside the image.
    #[error("the joint falls on pixel ({:.1}, {:.1}), outside the {width} x {height} image", pixel[0], pixel[1])]
    OutsideImage {
        /// Column and row.
        pixel: [f64; 2],
        /// Columns of the image.
        width: u32,
        /// Rows of the image.
        height: u32,
    },
    /// The square is smaller than a pixel.
    #[error(
        "a region of {side_mm} mm at {z_mm:.0} mm covers {pixels:.2} pixels, expected at least 1"
    )]
    TooSmall {
        /// Requested side.
        side_mm: f64,
        /// Depth of the joint.
        z_mm: f64,
        /// Side in the image.
        pixels: f64,
    },
}

/// The square of pixels around a joint (camera frame, mm) that shows `side_mm` at the joint's depth.
///
/// The size is that of a square with the projected area, local distortion included, at most the shorter side of the
/// image. Near the border the square is shifted until it lies inside, so its size does not depend on where the joint is.
///
/// # Errors
/// [`RoiError`] if the joint is not on the image or the square has no pixel.
pub fn roi_around(
    camera: &Camera,
    joint_in_camera: &Point3<f64>,
    side_mm: f64,
) -> Result<Roi, RoiError> {
    if !(side_mm > 0.0 && side_mm.is_finite()) {
        return Err(RoiError::Side(side_mm));
    }
    let (pixel, jacobian) = camera
        .project_with_jacobian(joint_in_camera)
        .ok_or_else(|| RoiError::NotInView {
            found_mm: (*joint_in_camera).into(),
        })?;
    let (width, height) = (camera.width(), camera.height());
    let on_image = |at: f64, pixels: u32| -0.5 <= at && at < f64::from(pixels) - 0.5;
    if !(on_image(pixel.x, width) && on_image(pixel.y, height)) {
        return Err(RoiError::OutsideImage {
            pixel: pixel.into(),
            width,
            height,
        });
    }
    let z_mm = joint_in_camera.z;
    let pixels = side_mm / z_mm * jacobian.determinant().abs().sqrt();
    if pixels < 1.0 {
        return Err(RoiError::TooSmall {
            side_mm,
            z_mm,
            pixels,
        });
    }
    let size = pixels.round().min(f64::from(width.min(height))) as u32;
    let start = |at: f64, pixels: u32| {
        let centred = (at - 0.5 * f64::from(size - 1)).round();
        centred.clamp(0.0, f64::from(pixels - size)) as u32
    };
    Ok(Roi {
        x_start: start(pixel.x, width),
        y_start: start(pixel.y, height),
        size,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{CameraModel, CameraSpec, DepthMode};
    use proptest::prelude::*;

    fn pinhole() -> Camera {
        let spec = CameraSpec {
            model: CameraModel::Pinhole,
            fx: 500.0,
            fy: 500.0,
            cx: 319.5,
            cy: 287.5,
            k1: 0.0,
            k2: 0.0,
            k3: 0.0,
            k4: 0.0,
            k5: 0.0,
            k6: 0.0,
            p1: 0.0,
            p2: 0.0,
            metric_radius: None,
            ..CameraSpec::azure_kinect(DepthMode::NfovUnbinned)
        };
        Camera::try_from(spec).unwrap()
    }

    #[test]
    fn a_200_mm_square_at_1_m_is_100_pixels_around_the_joint() {
        let roi = roi_around(&pinhole(), &Point3::new(0.0, 0.0, 1000.0), 200.0).unwrap();
        assert_eq!(
            roi,
            Roi {
                x_start: 270,
                y_start: 238,
                size: 100
            }
        ); // centre 319.5, 287.5
    }

    proptest! {
        #[test]
        fn the_square_lies_in_the_image_and_holds_the_joint(u in 0.0..639.0_f64, v in 0.0..575.0_f64,
            z_mm in 300.0..3000.0_f64, side_mm in 10.0..2000.0_f64) {
            let camera = Camera::try_from(CameraSpec::azure_kinect(DepthMode::NfovUnbinned)).unwrap();
            let slopes = camera.unproject(&nalgebra::Point2::new(u, v)).unwrap();
            let roi = roi_around(&camera, &Point3::new(slopes.x * z_mm, slopes.y * z_mm, z_mm), side_mm).unwrap();
            prop_assert!(roi.x_start + roi.size <= 640 && roi.y_start + roi.size <= 576);
            let inside = |at: f64, start: u32| f64::from(start) - 0.51 <= at && at <= f64::from(start + roi.size) - 0.49;
            prop_assert!(inside(u, roi.x_start) && inside(v, roi.y_start));
        }
    }

    #[test]
    fn a_joint_out_of_view_is_an_error() {
        let camera = pinhole();
        let around = |x, z, side_mm| roi_around(&camera, &Point3::new(x, 0.0, z), side_mm);
        assert!(matches!(
            around(0.0, -500.0, 200.0),
            Err(RoiError::NotInView { .. })
        ));
        assert!(matches!(
            around(900.0, 1000.0, 200.0),
            Err(RoiError::OutsideImage { .. })
        ));
        assert!(matches!(
            around(0.0, 1000.0, 0.5),
            Err(RoiError::TooSmall { .. })
        ));
        assert!(matches!(
            around(0.0, 1000.0, f64::NAN),
            Err(RoiError::Side(_))
        ));
    }
}
