//! Π_P: the plane under a limb.

use nalgebra::{Point3, Vector3};
use ppa_mesh::Mesh;

use crate::landmarks::choices::LandmarkError;
use crate::landmarks::contact::Profile;
use crate::landmarks::found::Landmarks;
use crate::landmarks::notes::LandmarkNote;

/// The three points of the plane that touches the limb from behind.
pub(crate) fn plane_under(
    limb: &Mesh,
    landmarks: &Landmarks,
) -> Result<[[f64; 3]; 3], LandmarkError> {
    const HALF_WIDTH_MM: f64 = 20.0;
    let patient_from_ct = landmarks.patient_from_ct();
    let points: Vec<Point3<f64>> = limb
        .vertices
        .iter()
        .map(|p| patient_from_ct * p.cast::<f64>())
        .collect();
    let profile = Profile::split(points.iter().map(|p| [p.z, p.y]));
    let (distal, proximal): (Vec<_>, Vec<_>) = points.iter().partition(|p| p.z < profile.split_mm);
    let tilt = profile
        .resting_tilt()
        .ok_or(LandmarkError::NoSupport)?
        .angle_rad;
    let up = Vector3::new(0.0, tilt.cos(), tilt.sin());
    let lowest = |half: &[&Point3<f64>]| {
        half.iter()
            .map(|p| (up.dot(&p.coords), **p))
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .ok_or(LandmarkError::NoSupport)
    };
    let ((distal_height, heel), (proximal_height, calf)) = (lowest(&distal)?, lowest(&proximal)?);
    let height = distal_height.min(proximal_height);
    let heel = heel - up * (distal_height - height);
    let calf = calf - up * (proximal_height - height);
    let aside = Vector3::x() * HALF_WIDTH_MM;
    let ct_from_patient = patient_from_ct.inverse();
    Ok([heel, calf - aside, calf + aside].map(|p| (ct_from_patient * p).coords.into()))
}

/// Notes or refuses a given plane that cuts the limb.
pub(crate) fn check_plane(limb: &Mesh, landmarks: &mut Landmarks) -> Result<(), LandmarkError> {
    let plane = landmarks
        .supporting_plane()
        .map_err(|expected| LandmarkError::Plane {
            found: landmarks.plane_points,
            expected,
        })?;
    let patient_from_ct = landmarks.patient_from_ct();
    let (mut behind, mut deepest) = (0_usize, 0.0_f64);
    for vertex in &limb.vertices {
        let height = plane.signed_distance(&(patient_from_ct * vertex.cast::<f64>()));
        behind += usize::from(height < 0.0);
        deepest = deepest.min(height);
    }
    let behind_percent = 100.0 * behind as f64 / limb.vertices.len() as f64;
    if behind_percent >= 50.0 {
        return Err(LandmarkError::PlaneThroughLimb { behind_percent });
    }
    landmarks.notes.push(LandmarkNote::PlaneGiven {
        behind_percent,
        deepest_mm: -deepest,
    });
    Ok(())
}
