//! The scene as a camera sees it: one point per pixel, as PLY.

use std::io::Write;
use std::path::Path;

use nalgebra::Point3;
use ppa_core::whole_file;

use crate::camera::projection::Camera;
use crate::image::{DepthError, DepthImage};
use crate::render::surface::Surface;

impl DepthImage {
    /// Points of the pixels that have a depth, row by row, in the frame of the camera that took the image, mm.
    ///
    /// # Errors
    /// [`DepthError::SizeMismatch`] if the image is not of the camera's size.
    pub fn points(&self, camera: &Camera) -> Result<Vec<Point3<f64>>, DepthError> {
        self.check_camera(camera)?;
        let surface = Surface::new(camera, self);
        Ok((0..self.z_mm.len())
            .filter_map(|pixel| surface.point(pixel))
            .collect())
    }

    /// Writes [`points`](Self::points) as a binary PLY cloud, atomically.
    ///
    /// # Errors
    /// [`DepthError::Write`] names the file; [`DepthError::SizeMismatch`].
    pub fn write_points(&self, camera: &Camera, path: &Path) -> Result<(), DepthError> {
        let points = self.points(camera)?;
        whole_file::write_with(path, |writer| {
            write!(writer, "ply\nformat binary_little_endian 1.0\n")?;
            writeln!(
                writer,
                "comment camera frame, mm: x right, y down, z forward"
            )?;
            writeln!(writer, "element vertex {}", points.len())?;
            write!(
                writer,
                "property float x\nproperty float y\nproperty float z\nend_header\n"
            )?;
            for value in points.iter().flat_map(|point| point.iter()) {
                writer.write_all(&(*value as f32).to_le_bytes())?;
            }
            Ok(())
        })
        .map_err(|source| DepthError::Write {
            path: path.into(),
            source,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{CameraSpec, DepthMode};

    #[test]
    fn a_point_falls_on_its_pixel_and_the_file_holds_it() {
        let camera = Camera::try_from(CameraSpec::azure_kinect(DepthMode::NfovBinned)).unwrap();
        let mut image = DepthImage::empty(320, 288);
        image.z_mm[100 * 320 + 20] = 1234.0;
        let points = image.points(&camera).unwrap();
        let pixel = camera.project(&points[0]).unwrap();
        assert!(
            points.len() == 1 && (pixel.x - 20.0).abs() < 1e-6 && (pixel.y - 100.0).abs() < 1e-6
        );
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("seen.ply");
        image.write_points(&camera, &path).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        let z = bytes.last_chunk::<4>().copied().map(f32::from_le_bytes);
        assert_eq!(z, Some(1234.0));
        assert!(matches!(
            DepthImage::empty(3, 3).write_points(&camera, &path),
            Err(DepthError::SizeMismatch { .. })
        ));
    }
}
