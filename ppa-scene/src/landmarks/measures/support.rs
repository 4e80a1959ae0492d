//! Contacts of a limb with its supporting plane.

use nalgebra::{Point3, Vector3};
use ppa_ct::Grid;
use ppa_mesh::Mesh;

use crate::landmarks::choices::LandmarkError;
use crate::landmarks::contact::Profile;
use crate::landmarks::found::Landmarks;

/// The contacts of a limb with its supporting plane.
#[derive(Debug, Clone, PartialEq)]
pub struct Support {
    /// Nearest distal and proximal point of the skin, `ct` frame, mm.
    pub contacts_mm: [[f64; 3]; 2],
    /// Distance of both along the axis, mm.
    pub span_mm: f64,
    /// How far the plane would pitch if one contact lay half a voxel's side higher, degrees.
    pub pitch_error_deg: f64,
    /// Unit normal of the plane, towards the limb, `ct` frame.
    pub normal: [f64; 3],
}

impl Support {
    pub(super) fn of(
        limb: &Mesh,
        landmarks: &Landmarks,
        grid: &Grid,
    ) -> Result<Self, LandmarkError> {
        let patient_from_ct = landmarks.patient_from_ct();
        let plane = landmarks.plane_patient();
        let points: Vec<Point3<f64>> = limb
            .vertices
            .iter()
            .map(|p| patient_from_ct * p.cast::<f64>())
            .collect();
        let profile = Profile::split(points.iter().map(|p| [p.z, p.y]));
        let nearest = |distal: bool| {
            points
                .iter()
                .filter(|p| (p.z < profile.split_mm) == distal)
                .min_by(|a, b| {
                    plane
                        .signed_distance(a)
                        .total_cmp(&plane.signed_distance(b))
                })
                .copied()
                .ok_or(LandmarkError::NoSupport)
        };
        let contacts = [nearest(true)?, nearest(false)?];
        let ct_from_patient = patient_from_ct.inverse();
        let normal: Vector3<f64> = ct_from_patient.isometry().rotation * plane.normal.into_inner();
        // The side of a voxel across the plane.
        let voxel_mm = (grid.direction().tr_mul(&normal))
            .component_mul(&grid.spacing_mm())
            .norm();
        let tilt_rad = plane.normal.z.atan2(plane.normal.y);
        Ok(Self {
            contacts_mm: contacts.map(|p| (ct_from_patient * p).coords.into()),
            span_mm: contacts[1].z - contacts[0].z,
            pitch_error_deg: pitch_error_rad(&profile, tilt_rad, 0.5 * voxel_mm).to_degrees(),
            normal: normal.into(),
        })
    }
}

/// The larger of the two tilts away from `tilt_rad` at which one end is `lift_mm` nearer to the plane
/// than the other; at most a right angle.
fn pitch_error_rad(profile: &Profile, tilt_rad: f64, lift_mm: f64) -> f64 {
    const LARGEST_RAD: f64 = 1.2;
    const STEPS: u32 = 40;
    let apart = |angle_rad: f64| {
        let [distal, proximal] = profile.heights(angle_rad);
        distal - proximal
    };
    let there = apart(tilt_rad);
    let reach = |sign: f64| {
        let (mut near, mut far) = (0.0, LARGEST_RAD);
        for _ in 0..STEPS {
            let middle = 0.5 * (near + far);
            match (apart(tilt_rad + sign * middle) - there).abs() < lift_mm {
                true => near = middle,
                false => far = middle,
            }
        }
        near
    };
    reach(1.0).max(reach(-1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// On two points the pitch is wrong by the angle whose sine is lift over span; a cylinder that rests on its
    /// middle pitches far more.
    #[test]
    fn pitch_error_is_lift_over_span_or_worse() {
        let points = [[-60.0, 0.0], [140.0, 0.0], [0.0, 90.0]];
        let profile = Profile::split(points.into_iter());
        let found = pitch_error_rad(&profile, 0.0, 1.0);
        assert!((found - (1.0_f64 / 200.0).asin()).abs() < 1e-9, "{found}");
        let round = (-50..=50).map(|degrees| {
            let angle = f64::from(degrees).to_radians();
            [300.0 * angle.sin(), -300.0 * angle.cos()]
        });
        let found = pitch_error_rad(&Profile::split(round), 0.0, 1.0).to_degrees();
        assert!(found > 4.0, "{found} degrees");
    }
}
