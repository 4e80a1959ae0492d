//! Position of a camera that looks at a given point.

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

/// Position of a camera relative to the point it looks at, in a frame whose z points up.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Viewpoint {
    /// Angle from the frame's x towards its y, degrees.
    pub azimuth_deg: f64,
    /// Angle above the horizontal, degrees: 90 is straight above.
    pub elevation_deg: f64,
    /// Distance from the point to the camera, mm.
    pub distance_mm: f64,
}

impl Viewpoint {
    /// The camera at `position` as `target` sees it; straight above and below have the azimuth 0.
    pub fn of(position: &Point3<f64>, target: &Point3<f64>) -> Self {
        let way = position - target;
        Self {
            azimuth_deg: way.y.atan2(way.x).to_degrees(),
            elevation_deg: way.z.atan2(way.xy().norm()).to_degrees(),
            distance_mm: way.norm(),
        }
    }

    /// Directions above `lowest_deg` about `step_deg` apart, at each of the distances; straight above is one of them.
    ///
    /// Rings of equal elevation, from above, with enough directions that they are no further apart than the rings; the first of
    /// each ring lies along x.
    pub fn dome(step_deg: f64, lowest_deg: f64, distances_mm: &[f64]) -> Vec<Self> {
        let rings = ((90.0 - lowest_deg) / step_deg + 1e-9).floor().max(0.0) as u32;
        let on_ring = |ring: u32| {
            let elevation_deg = 90.0 - f64::from(ring) * step_deg;
            let around = (360.0 * elevation_deg.to_radians().cos() / step_deg - 1e-9).ceil();
            let count = around.max(1.0) as u32;
            (0..count).map(move |i| (360.0 * f64::from(i) / f64::from(count), elevation_deg))
        };
        let at = |distance_mm: f64| {
            let directions = (0..=rings).flat_map(on_ring);
            directions.map(move |(azimuth_deg, elevation_deg)| Self {
                azimuth_deg,
                elevation_deg,
                distance_mm,
            })
        };
        distances_mm.iter().copied().flat_map(at).collect()
    }

    /// Motion from a camera at this viewpoint that looks at `target` to the target's frame. Image rows are horizontal, with higher
    /// points on top; straight above and below, the frame's y points up in the image.
    pub fn frame_from_camera(&self, target: &Point3<f64>) -> Isometry3<f64> {
        let (sin, cos) = self.elevation_deg.to_radians().sin_cos();
        let (across, along) = self.azimuth_deg.to_radians().sin_cos();
        let way = Vector3::new(cos * along, cos * across, sin);
        // Within a thousandth of a degree of the vertical, its rows are undetermined.
        let down = if cos.abs() < 2e-5 {
            -Vector3::y()
        } else {
            -Vector3::z()
        };
        looking_at(&(target + way * self.distance_mm), target, &down)
    }
}

/// Motion from a camera that looks at `target`, with the part of `down` across its axis down in the image.
pub(crate) fn looking_at(
    position: &Point3<f64>,
    target: &Point3<f64>,
    down: &Vector3<f64>,
) -> Isometry3<f64> {
    let forward = (target - position).normalize();
    let down = (down - forward * forward.dot(down)).normalize();
    let axes = Matrix3::from_columns(&[down.cross(&forward), down, forward]);
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
    Isometry3::from_parts(Translation3::from(position.coords), rotation)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_camera_looks_at_its_target_upright(azimuth_deg in -179.0..179.0_f64, elevation_deg in -89.0..89.0_f64,
            distance_mm in 100.0..3000.0_f64) {
            let target = Point3::new(10.0, -200.0, 60.0);
            let viewpoint = Viewpoint { azimuth_deg, elevation_deg, distance_mm };
            let frame_from_camera = viewpoint.frame_from_camera(&target);
            let seen = frame_from_camera.inverse() * target;
            prop_assert!((seen - Point3::new(0.0, 0.0, distance_mm)).norm() < 1e-9);
            let (right, down) = (frame_from_camera * Vector3::x(), frame_from_camera * Vector3::y());
            prop_assert!(right.z.abs() < 1e-9 && down.z < 0.0);
            let position = frame_from_camera * Point3::origin();
            let back = Viewpoint::of(&position, &target);
            prop_assert!((back.azimuth_deg - azimuth_deg).abs() < 1e-6);
            prop_assert!((back.elevation_deg - elevation_deg).abs() < 1e-6);
            prop_assert!((back.distance_mm - distance_mm).abs() < 1e-6);
        }
    }

    #[test]
    fn from_above_the_frames_y_points_up_in_the_image() {
        let above = Viewpoint {
            azimuth_deg: 0.0,
            elevation_deg: 90.0,
            distance_mm: 1000.0,
        };
        let camera_from_frame = above.frame_from_camera(&Point3::origin()).inverse();
        let seen = camera_from_frame * Point3::new(3.0, 5.0, 0.0);
        assert!((seen - Point3::new(3.0, -5.0, 1000.0)).norm() < 1e-9);
    }

    /// Around half a sphere 30 degrees apart: 1 + 6 + 11 (12 sin 60° = 10.4) + 12 directions.
    #[test]
    fn a_dome_is_evenly_filled() {
        let dome = Viewpoint::dome(30.0, 0.0, &[700.0, 900.0]);
        let count = |elevation: f64| {
            (dome.iter()).filter(move |v| (v.elevation_deg - elevation).abs() < 1e-9)
        };
        let rings = [90.0, 60.0, 30.0, 0.0].map(|elevation| count(elevation).count() / 2);
        assert_eq!((rings, dome.len()), ([1, 6, 11, 12], 60));
    }
}
