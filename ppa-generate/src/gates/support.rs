//! Contacts of the supporting plane with the skin.

use nalgebra::{Point3, Vector3};
use ppa_ct::Volume;
use ppa_dataset::findings::{Finding, FindingCode, Severity};
use ppa_mesh::LimbReport;
use ppa_scene::{LandmarkNote, Landmarks, Support};

use super::at;

/// A contact within this distance of a face of the volume that cuts the limb may lie on the cut, voxels.
const NEAR_CUT: f64 = 1.5;

/// A normal closer than this to an axis of the image was not measured on skin, radians: over 200 mm it is 0.2 mm, less than the roughness
/// of skin.
const ALONG_IMAGE_RAD: f64 = 1e-3;

/// Contacts closer together than this do not determine the pitch, mm: a height error of 1 mm at one of them tilts the plane by 1.1 degrees,
/// and over the second length by 0.6.
const SPAN_SEVERE_MM: f64 = 50.0;
const SPAN_CAUTION_MM: f64 = 100.0;

/// Pitches that half a voxel changes by more than this are doubted, degrees: as with axes inclined to the shaft, a joint space closes to
/// the beam at about 7.
const PITCH_SEVERE_DEG: f64 = 4.0;
const PITCH_CAUTION_DEG: f64 = 2.0;

pub(super) fn findings(
    volume: &Volume,
    report: &LimbReport,
    landmarks: &Landmarks,
    support: &Support,
) -> Vec<Finding> {
    let mut found = Vec::new();
    match along_image(volume, report, support) {
        Some(finding) => found.push(finding),
        None => found.extend(on_cut(volume, report, support)),
    }
    found.extend(too_near(support));
    for note in &landmarks.notes {
        if let LandmarkNote::PlaneGiven {
            behind_percent,
            deepest_mm,
        } = *note
        {
            found.push(at(
                landmarks.plane_points[0],
                FindingCode::PlaneGiven,
                if deepest_mm > DEEP_MM { Severity::Caution } else { Severity::Note },
                deepest_mm,
                format!(
                    "the plane points were given; {behind_percent:.1} % of the skin lies behind their plane, up to \
                     {deepest_mm:.1} mm"
                ),
            ));
        }
    }
    found
}

/// Skin may lie this far behind a given plane, mm, since soft tissue yields.
const DEEP_MM: f64 = 5.0;

/// Faces of the volume that cut the limb, with image axis, layer index and name.
fn cuts(report: &LimbReport) -> impl Iterator<Item = (usize, f64, &str)> {
    report.cut_faces.iter().filter_map(|cut| {
        let axis = ["i", "j", "k"]
            .iter()
            .position(|name| cut.face.ends_with(name))?;
        let layer = match cut.face.starts_with('-') {
            true => report.low[axis],
            false => report.high[axis] - 1,
        };
        Some((axis, layer as f64, cut.face.as_str()))
    })
}

/// Findings about contacts on faces along the scan axis that cut the limb; at the ends of the scan, skin is skin.
fn on_cut(volume: &Volume, report: &LimbReport, support: &Support) -> Vec<Finding> {
    let grid = volume.grid();
    let scan_axis = grid.direction().transpose().column(2).iamax();
    let on_face = |contact_mm: [f64; 3]| {
        let voxel = grid.voxel_from_ct() * Point3::from(contact_mm);
        cuts(report)
            .filter(|(axis, ..)| *axis != scan_axis)
            .find(|(axis, layer, _)| (voxel[*axis] - layer).abs() <= NEAR_CUT)
    };
    let contacts = support.contacts_mm.into_iter().zip(["distal", "proximal"]);
    let findings = contacts.filter_map(|(contact_mm, end)| {
        let (_, _, face) = on_face(contact_mm)?;
        let [x, y, z] = contact_mm;
        Some(Finding {
            code: FindingCode::PlaneOnCut,
            severity: Severity::Severe,
            text: format!(
                "the {end} contact of the supporting plane, at {x:.0}, {y:.0}, {z:.0} mm, lies on the face {face} where the \
                 field of view cuts the limb: the plane follows the cut, not the skin (--plane-point gives another one)"
            ),
            value: None,
            place_mm: Some(contact_mm),
        })
    });
    findings.collect()
}

/// Finding about a plane perpendicular to an image axis whose contacts lie on a cut face of that axis. Elsewhere such a plane is correct: a
/// limb can lie on a level couch.
fn along_image(volume: &Volume, report: &LimbReport, support: &Support) -> Option<Finding> {
    let normal = Vector3::from(support.normal);
    let grid = volume.grid();
    let (axis, angle_rad) = (0..3)
        .map(|axis| {
            let along: Vector3<f64> = grid.direction().column(axis).into_owned();
            (axis, along.cross(&normal).norm().asin())
        })
        .min_by(|a, b| a.1.total_cmp(&b.1))?;
    if angle_rad > ALONG_IMAGE_RAD {
        return None;
    }
    let at_cut = |layer: f64| {
        let voxels = support
            .contacts_mm
            .map(|contact| grid.voxel_from_ct() * Point3::from(contact));
        voxels
            .iter()
            .all(|voxel| (voxel[axis] - layer).abs() <= NEAR_CUT)
    };
    let (_, _, face) = cuts(report).find(|(of, layer, _)| *of == axis && at_cut(*layer))?;
    Some(at(
        support.contacts_mm[0],
        FindingCode::PlaneAlongImage,
        Severity::Severe,
        angle_rad.to_degrees(),
        format!(
            "the supporting plane is the face {face} where the field of view cuts the limb (its normal is the image's axis within \
             {:.4} degrees), not a plane under the skin (--plane-point gives another one)",
            angle_rad.to_degrees()
        ),
    ))
}

fn too_near(support: &Support) -> Option<Finding> {
    let (span_mm, error_deg) = (support.span_mm, support.pitch_error_deg);
    let severity = if span_mm < SPAN_SEVERE_MM || error_deg > PITCH_SEVERE_DEG {
        Severity::Severe
    } else if span_mm < SPAN_CAUTION_MM || error_deg > PITCH_CAUTION_DEG {
        Severity::Caution
    } else {
        return None;
    };
    Some(at(
        support.contacts_mm[1],
        FindingCode::ContactsTooNear,
        severity,
        span_mm,
        format!(
            "the distal and the proximal contact of the supporting plane lie {span_mm:.0} mm apart along the axis, and half a \
             voxel of height at one of them pitches the limb by {error_deg:.1} degrees; expected at least {SPAN_CAUTION_MM:.0} mm \
             and at most {PITCH_CAUTION_DEG:.0} degrees"
        ),
    ))
}
