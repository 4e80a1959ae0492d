//! Picture for checking a prepared limb: three slices and three views of the skin.

use image::RgbImage;
use nalgebra::Vector3;
use ppa_dataset::findings::{Finding, FindingCode, Severity};
use ppa_generate::PreparedLimb;
use ppa_scene::{AxisSource, Landmarks, LimbKind, Side};

use super::canvas::{Rect, mixed};
use super::cut_faces::cut_faces;
use super::limb_marks::LimbMarks;
use super::palette::{AXIS, CALF_REGION, CUT, JOINT, JOINT_REGION, OUTLINE, PANEL, PLANE, SKIN};
use super::sheet::{Frame, GAP, HEADER, PANELS_END, Remark, Swatch, WIDTH};
use super::skin::draw_skin;
use super::slice::draw_slice;

/// Width of a panel, pixels.
const PANEL_WIDTH: u32 = 396;
const PANEL_HEIGHT: u32 = (PANELS_END - HEADER - GAP) / 2;

/// Draws a prepared limb: slices through the joint (axial, coronal, sagittal) above, the skin from the front, its lateral side
/// and behind below, with axis, joint, axis regions, supporting plane and cut faces.
///
/// `name` is the heading: a file's name without folders. Severe findings that are `acknowledged` no longer count as severe. Severe
/// findings and cautions with a place are numbered, in the list and on the skin. At least 1600 x 1000 pixels; the same limb gives
/// the same pixels.
pub fn case_picture(name: &str, limb: &PreparedLimb, acknowledged: &[FindingCode]) -> RgbImage {
    let landmarks = &limb.landmarks;
    let places = placed_findings(limb).filter_map(|f| f.place_mm);
    let marks = LimbMarks::new(landmarks, places.map(Into::into).collect());
    let cuts = cut_faces(&limb.limb, limb.volume.grid());
    let legend = Rect {
        x: 4 * GAP + 3 * PANEL_WIDTH,
        y: HEADER,
        width: WIDTH - 5 * GAP - 3 * PANEL_WIDTH,
        height: PANELS_END - HEADER,
    };
    let mut canvas = frame(name, limb, acknowledged).canvas(legend);
    let [x, y, z] = [Vector3::x(), Vector3::y(), Vector3::z()];
    // Radiological convention: from the feet, from the front, and with the front to the left.
    let slices = [("axial", x, -y), ("coronal", x, z), ("sagittal", y, z)];
    for (column, slice) in slices.into_iter().enumerate() {
        draw_slice(&mut canvas, panel(column, 0), limb, &marks, slice);
    }
    for (column, view) in skin_views(landmarks).into_iter().enumerate() {
        let meshes = [&limb.limb.mesh, &cuts];
        draw_skin(&mut canvas, panel(column, 1), meshes, &marks, view);
    }
    canvas.into_image()
}

/// Position of a panel.
pub(super) fn panel(column: usize, row: u32) -> Rect {
    Rect {
        x: GAP + column as u32 * (PANEL_WIDTH + GAP),
        y: HEADER + row * (PANEL_HEIGHT + GAP),
        width: PANEL_WIDTH,
        height: PANEL_HEIGHT,
    }
}

/// Title, direction to the right and upwards in the ct frame, for each view of the skin.
fn skin_views(landmarks: &Landmarks) -> [(&'static str, Vector3<f64>, Vector3<f64>); 3] {
    let ct_from_patient = landmarks.patient_from_ct().inverse();
    let [right, anterior, proximal] =
        [Vector3::x(), Vector3::y(), Vector3::z()].map(|axis| ct_from_patient.rotate(&axis));
    let to_front = match landmarks.side {
        Side::Right => anterior,
        Side::Left => -anterior,
    };
    [
        ("skin, front", -right, proximal),
        ("skin, lateral", to_front, proximal),
        ("skin, from behind", right, proximal),
    ]
}

/// Findings with a place that a person should check, most severe first: their numbers are their positions in this list, from 1.
fn placed_findings(limb: &PreparedLimb) -> impl Iterator<Item = &Finding> {
    let of = |severity| {
        let findings = limb.findings.iter();
        findings.filter(move |f| f.severity == severity && f.place_mm.is_some())
    };
    of(Severity::Severe).chain(of(Severity::Caution))
}

/// Findings about a limb.
pub(super) fn remarks(limb: &PreparedLimb, acknowledged: &[FindingCode]) -> Vec<Remark> {
    let found = limb.findings.iter().map(|finding| {
        let number = placed_findings(limb).position(|placed| placed == finding);
        let number = number.map_or(String::new(), |at| format!("({}) ", at + 1));
        let is_known = acknowledged.contains(&finding.code);
        let (severity, known) = match finding.severity {
            Severity::Severe if is_known => (Severity::Caution, " [acknowledged]"),
            severity => (severity, ""),
        };
        Remark {
            severity,
            text: format!("{number}{}{known}", finding.text),
        }
    });
    found.collect()
}

/// Name of the limb in two words.
pub(super) fn limb_name(landmarks: &Landmarks) -> String {
    let side = landmarks.side;
    let kind = match landmarks.limb {
        LimbKind::LowerLeg => "lower leg",
        LimbKind::Knee => "knee",
        LimbKind::Other => "limb (neither ankle nor knee)",
    };
    format!("{side} {kind}")
}

fn frame(name: &str, limb: &PreparedLimb, acknowledged: &[FindingCode]) -> Frame {
    let landmarks = &limb.landmarks;
    let range = |[from, to]: [f64; 2]| format!("{from:.0} to {to:.0} mm");
    let legend = [
        (Swatch::Line(OUTLINE), "skin in the slice".to_owned()),
        (
            Swatch::Area(mixed([128; 3], PANEL, 0.55)),
            "not the limb".to_owned(),
        ),
        (Swatch::Line(AXIS), "axis".to_owned()),
        (Swatch::Dot(JOINT), "joint".to_owned()),
        (
            Swatch::Area(mixed(SKIN, JOINT_REGION, 0.5)),
            format!("joint region {}", range(landmarks.joint_region.range_mm)),
        ),
        (
            Swatch::Area(mixed(SKIN, CALF_REGION, 0.5)),
            format!("calf region {}", range(landmarks.calf_region.range_mm)),
        ),
        (
            Swatch::Line(PLANE),
            "plane under the limb; dots: its three points".to_owned(),
        ),
        (Swatch::Area(CUT), "cut by the field of view".to_owned()),
    ];
    let [x, y, z] = landmarks.joint_centre;
    let axis_of = match landmarks.axis_source {
        AxisSource::Bone => "axis of the bone",
        AxisSource::Limb => "axis of the whole limb",
        AxisSource::Given => "axis given",
    };
    let report = &limb.limb.report;
    let spacing = limb.volume.grid().spacing_mm();
    let mut facts = vec![
        format!("joint {x:.0} {y:.0} {z:.0} mm"),
        axis_of.to_owned(),
        format!("limb {:.0} ml", report.limb_mm3 * 1e-3),
        format!(
            "voxels {:.2} x {:.2} x {:.2} mm",
            spacing.x, spacing.y, spacing.z
        ),
    ];
    for cut in &report.cut_faces {
        facts.push(format!(
            "cut at {}: {:.1} cm2",
            cut.face,
            cut.area_mm2 * 1e-2
        ));
    }
    Frame {
        title: format!("{name}   {}", limb_name(landmarks)),
        legend: legend.to_vec(),
        facts,
        remarks: remarks(limb, acknowledged),
    }
}
